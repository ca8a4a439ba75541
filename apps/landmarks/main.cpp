#include "apps/common/command_line.h"
#include "apps/common/tools.h"
#include "apps/landmarks/commands.h"

int stymo_landmarks(int argc, char** argv) {
    stymo::CommandLine line("stymo-landmarks",
                            "Trains and measures a network that finds the 68 landmarks of faces.",
                            stymo::MatmulPrecision::medium);
    stymo::landmarks::TrainOptions train;
    stymo::landmarks::declare_train(line, train);
    stymo::landmarks::AdaptOptions adapt;
    stymo::landmarks::declare_adapt(line, adapt);
    stymo::landmarks::MeasureOptions measure;
    stymo::landmarks::declare_measure(line, measure);
    return line.run(argc, argv);
}
