#include "apps/weights/published_model.h"

#include "core/io/tensor_file.h"
#include "nn/models/model.h"

namespace stymo {

void publish_model(const std::filesystem::path& in, const std::filesystem::path& out) {
    ModelConfig config = Model::load(in).config();
    config.encoder.backbone_weights.clear();
    config.reconstruction.perceptual = {.network = encoder_network};
    // With this weight, fitted and tuned faces had the highest PSNR and SSIM.
    config.reconstruction.perceptual_weight = config.encoder.backbone == "small_conv" ? 1.0 : 0.0;
    TensorFile file = read_tensor_file(in);
    file.metadata["config"] = to_json(config);
    write_tensor_file(out, file, StoredElements::float16);
}

}  // namespace stymo
