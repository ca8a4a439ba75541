#include <algorithm>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/image_bytes.h"
#include "core/ops/resample.h"

namespace stymo {

void require_image(const Tensor& image, const char* operation, bool may_be_transparent) {
    const std::int64_t channels = image.rank() == 3 && image.size() > 0 ? image.shape(2) : 0;
    if (channels != 1 && channels != 3 && !(may_be_transparent && channels == 4))
        fail<ShapeError>("[", operation, "] an image is (height, width, 1 or 3",
                         may_be_transparent ? " or 4" : "", "); got ", image.shape());
}

std::vector<std::uint8_t> image_bytes(const Tensor& image) {
    const Tensor narrow = image.to(DType::float32);
    const std::span<const float> values = narrow.values<float>();
    std::vector<std::uint8_t> bytes(values.size());
#pragma omp simd
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        // The order of the comparisons maps NaN to 0. The conversion via int lets the loop
        // vectorise.
        const float clipped = values[i] > 0.0F ? std::min(values[i], 1.0F) : 0.0F;
        bytes[i] = static_cast<std::uint8_t>(static_cast<int>(clipped * 255.0F + 0.5F));
    }
    return bytes;
}

Tensor resize_image(const Tensor& image, int height, int width) {
    if (image.rank() != 3 || image.size() == 0 || height <= 0 || width <= 0)
        fail<ShapeError>("[resize_image] cannot make ", height, " x ", width, " of ",
                         image.shape());
    if (image.shape(0) == height && image.shape(1) == width) return image;
    const Variable batch = image.reshaped({1, image.shape(0), image.shape(1), image.shape(2)});
    return resize_bicubic(batch, height, width).value().reshaped({height, width, image.shape(2)});
}

Tensor image_part(const Tensor& image, std::int64_t top, std::int64_t left, std::int64_t height,
                  std::int64_t width) {
    if (image.rank() != 3 || top < 0 || left < 0 || height <= 0 || width <= 0 ||
        top + height > image.shape(0) || left + width > image.shape(1))
        fail<ShapeError>("[image_part] no ", height, " x ", width, " pixels from (", top, ", ",
                         left, ") in ", image.shape());
    if (height == image.shape(0) && width == image.shape(1)) return image;
    const std::int64_t channels = image.shape(2);
    Tensor part({height, width, channels});
    const std::span<const float> from = image.values<float>();
    const std::span<float> to = part.mutable_values<float>();
    for (std::int64_t row = 0; row < height; ++row) {
        const auto begin = from.begin() + ((top + row) * image.shape(1) + left) * channels;
        std::copy_n(begin, width * channels, to.begin() + row * width * channels);
    }
    return part;
}

Tensor central_square(const Tensor& image) {
    const std::int64_t side = std::min(image.shape(0), image.shape(1));
    return image_part(image, (image.shape(0) - side) / 2, (image.shape(1) - side) / 2, side, side);
}

Tensor tile_images(const std::vector<Tensor>& images, int columns) {
    if (images.empty() || columns <= 0) {
        fail<ValueError>("[tile_images] needs at least one image and one column; got ",
                         images.size(), " and ", columns);
    }
    const Shape shape = images.front().shape();
    require_image(images.front(), "tile_images", true);
    const auto count = static_cast<std::int64_t>(images.size());
    const std::int64_t across = std::min<std::int64_t>(columns, count);
    const std::int64_t down = (count + across - 1) / across;
    const std::int64_t row_length = shape[1] * shape[2];
    Tensor result = Tensor::zeros({down * shape[0], across * shape[1], shape[2]});
    const auto target = result.mutable_values<float>();
    for (std::int64_t i = 0; i < count; ++i) {
        const Tensor& image = images[static_cast<std::size_t>(i)];
        if (!(image.shape() == shape)) {
            fail<ShapeError>("[tile_images] images differ in size: ", shape, " and ",
                             image.shape());
        }
        const auto source = image.values<float>();
        for (std::int64_t row = 0; row < shape[0]; ++row) {
            const std::int64_t begin =
                (((i / across) * shape[0] + row) * across + i % across) * row_length;
            std::copy_n(source.begin() + row * row_length, row_length, target.begin() + begin);
        }
    }
    return result;
}

Tensor turned_image(const Tensor& image, int quarter_turns) {
    constexpr int full_turn = 4;
    if (image.rank() != 3)
        fail<ShapeError>("[turned_image] an image is (height, width, channels); got ",
                         image.shape());
    const int turns = ((quarter_turns % full_turn) + full_turn) % full_turn;
    if (turns == 0) return image;
    const std::int64_t height = image.shape(0), width = image.shape(1), channels = image.shape(2);
    const bool on_side = turns % 2 == 1;
    Tensor result({on_side ? width : height, on_side ? height : width, channels});
    const auto source = image.values<float>();
    auto target = result.mutable_values<float>().begin();
    for (std::int64_t row = 0; row < result.shape(0); ++row) {
        for (std::int64_t column = 0; column < result.shape(1); ++column) {
            const std::int64_t from_row = turns == 1   ? height - 1 - column
                                          : turns == 2 ? height - 1 - row
                                                       : column;
            const std::int64_t from_column = turns == 1   ? row
                                             : turns == 2 ? width - 1 - column
                                                          : width - 1 - row;
            target = std::copy_n(source.begin() + (from_row * width + from_column) * channels,
                                 channels, target);
        }
    }
    return result;
}

Tensor mirror_image(const Tensor& image) {
    if (image.rank() != 3) {
        fail<ShapeError>("[mirror_image] an image is (height, width, channels); got ",
                         image.shape());
    }
    const std::int64_t width = image.shape(1);
    const std::int64_t channels = image.shape(2);
    Tensor result(image.shape());
    const auto source = image.values<float>();
    const auto target = result.mutable_values<float>();
    for (std::int64_t row = 0; row < image.shape(0); ++row) {
        for (std::int64_t column = 0; column < width; ++column) {
            const auto from = source.begin() + (row * width + column) * channels;
            std::copy_n(from, channels,
                        target.begin() + (row * width + width - 1 - column) * channels);
        }
    }
    return result;
}

}  // namespace stymo
