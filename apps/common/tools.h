#pragma once

/// The tools. Each is the main function of an executable (stymo-bench and so on). Tests call them
/// too.
int stymo_bench(int argc, char** argv);
int stymo_drive(int argc, char** argv);
int stymo_edit(int argc, char** argv);
int stymo_eval(int argc, char** argv);
int stymo_export(int argc, char** argv);
int stymo_fit(int argc, char** argv);
int stymo_prep(int argc, char** argv);
int stymo_render(int argc, char** argv);
int stymo_synth(int argc, char** argv);
int stymo_train(int argc, char** argv);
int stymo_view(int argc, char** argv);
int stymo_weights(int argc, char** argv);
