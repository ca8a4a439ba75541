#include <iomanip>

#include "apps/common/tools.h"
#include "apps/export/commands.h"
#include "core/io/image.h"

namespace stymo {

void check_against_frames(const std::filesystem::path& picture, const Model& model,
                          const Codes& codes, const DrawnFrom& draw, std::ostream& text,
                          JsonValue& json) {
    const std::vector<FrameComparison> all =
        compared_with_frames(model, codes, draw, {-60, -45, -30, -15, 0, 15, 30, 45, 60});
    std::vector<Tensor> pictures;
    for (const FrameComparison& view : all) pictures.push_back(view.frame);
    for (const FrameComparison& view : all) pictures.push_back(view.rendered);
    write_image(picture, tile_images(pictures, static_cast<int>(all.size())));
    text << "against the model's frames   PSNR dB   inside both   overlap\n"
         << std::fixed << std::setprecision(2);
    std::vector<double> yaws, psnr, inside, overlap;
    for (const FrameComparison& view : all) {
        text << std::setw(16) << view.yaw << " degrees" << std::setw(12) << view.psnr
             << std::setw(14) << view.psnr_inside << std::setw(10) << view.overlap << '\n';
        yaws.push_back(view.yaw);
        psnr.push_back(view.psnr);
        inside.push_back(view.psnr_inside);
        overlap.push_back(view.overlap);
    }
    text << picture.string() << '\n';
    json.add("check",
             JsonValue::object(
                 {{"yaw", yaws}, {"psnr", psnr}, {"psnr_inside", inside}, {"overlap", overlap}}));
}

}  // namespace stymo

int stymo_export(int argc, char** argv) {
    stymo::CommandLine line("stymo-export",
                            "Writes fitted faces in the formats of other programs: textured meshes "
                            "with ARKit's blend shapes, their coefficients, and splats.");
    stymo::declare_mesh(line);
    stymo::declare_splat(line);
    stymo::declare_arkit(line);
    return line.run(argc, argv);
}
