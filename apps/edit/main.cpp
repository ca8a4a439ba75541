#include "apps/edit/color.h"
#include "apps/edit/disentangle.h"
#include "apps/edit/mix.h"

int main(int argc, char** argv) {
    stymo::MixOptions mix;
    stymo::ColorOptions color;
    stymo::DisentangleOptions disentangle;
    stymo::CommandLine line("stymo-edit", "Mixes fitted faces, gives their parts other colours, measures how well the two work.");
    stymo::declare_mix(line, mix);
    stymo::declare_color(line, color);
    stymo::declare_disentangle(line, disentangle);
    return line.run(argc, argv);
}
