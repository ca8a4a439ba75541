#include "apps/common/tools.h"
#include "apps/edit/commands.h"

int stymo_edit(int argc, char** argv) {
    stymo::CommandLine line("stymo-edit",
                            "Mixes fitted faces, recolours parts of them, and measures how "
                            "disentangled the codes are.");
    stymo::declare_mix(line);
    stymo::declare_color(line);
    stymo::declare_disentangle(line);
    return line.run(argc, argv);
}
