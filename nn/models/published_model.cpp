#include "nn/models/published_model.h"

#include "core/io/tensor_file.h"
#include "nn/models/model.h"

namespace stymo {

void publish_model(const std::filesystem::path& in, const std::filesystem::path& out) {
    ModelConfig config = Model::load(in).config();
    config.encoder.backbone_weights.clear();
    config.reconstruction.perceptual = {.network = encoder_network};
    if (config.encoder.backbone != "small_conv") config.reconstruction.perceptual_weight = 0.0;
    TensorFile file = read_tensor_file(in);
    file.metadata["config"] = to_json(config);
    write_tensor_file(out, file, StoredElements::float16);
}

}  // namespace stymo
