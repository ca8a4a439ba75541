#include "apps/common/tools.h"
#include "apps/export/commands.h"

int stymo_export(int argc, char** argv) {
    stymo::CommandLine line("stymo-export",
                            "Writes fitted faces in the formats of other programs: textured meshes "
                            "with ARKit's blend shapes, their coefficients, and splats.");
    stymo::declare_mesh(line);
    stymo::declare_splat(line);
    stymo::declare_arkit(line);
    return line.run(argc, argv);
}
