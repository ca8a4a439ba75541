#include "apps/c/stymo.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <new>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "fit/studio.h"

struct stymo_model {
    stymo::Studio studio;
};
struct stymo_face {
    explicit stymo_face(stymo::StudioFace made) : face(std::move(made)) {
        for (const std::string& warning : face.warnings)
            warnings += (warnings.empty() ? "" : "\n") + warning;
    }

    stymo::StudioFace face;
    std::string warnings;
};

namespace {

thread_local std::string last_error;  // NOLINT: C has no other way to return a message

/// The result of `body`, or `failed` and the message of what it throws.
template <class T, class Body>
T guarded(T failed, const Body& body) noexcept {
    try {
        try {
            return body();
        } catch (const std::bad_alloc&) {
            last_error = "out of memory";
        } catch (const std::exception& error) {
            last_error = error.what();
            std::ranges::replace(last_error, '\n', ' ');
        } catch (...) {
            last_error = "an unknown error";
        }
    } catch (...) {
        last_error.clear();  // no memory for the message
    }
    return failed;
}

template <class T>
const T& given(const T* pointer, const char* name) {
    if (pointer == nullptr) stymo::fail<stymo::ValueError>(name, " is NULL");
    return *pointer;
}

std::filesystem::path path_or_empty(const char* path) {
    return path == nullptr ? std::filesystem::path() : std::filesystem::path(path);
}

stymo::Tensor photo_of(const std::uint8_t* rgb, int height, int width) {
    static_cast<void>(given(rgb, "rgb"));
    if (height < 1 || width < 1)
        stymo::fail<stymo::ValueError>("a photo of ", height, " x ", width, " pixels is empty");
    return stymo::tensor_from_bytes({rgb, static_cast<std::size_t>(height) * width * 3},
                                    {height, width, 3});
}

stymo_face* owned(stymo::StudioFace face) {
    return new stymo_face(std::move(face));
}

}  // namespace

const char* stymo_version() {
    return STYMO_VERSION;
}

const char* stymo_error() {
    return last_error.c_str();
}

int stymo_set_threads(int count) {
    return guarded(-1, [&] { return stymo::set_thread_count(count), 0; });
}

stymo_model* stymo_model_load(const char* path, const char* configs) {
    return guarded<stymo_model*>(nullptr, [&] {
        return new stymo_model{stymo::Studio(path_or_empty(path), path_or_empty(configs))};
    });
}

void stymo_model_free(stymo_model* model) {
    delete model;
}

int stymo_model_side(const stymo_model* model) {
    return guarded(-1, [&] {
        return static_cast<int>(given(model, "model").studio.model().config().decoder.resolution);
    });
}

stymo_face* stymo_fit(const stymo_model* model, const std::uint8_t* rgb, int height, int width,
                      int steps) {
    return guarded<stymo_face*>(nullptr, [&] {
        const stymo::Studio& studio = given(model, "model").studio;
        stymo::FitJobOptions options = studio.fit_options();
        if (steps < 0) stymo::fail<stymo::ValueError>(steps, " steps; give 0 or more");
        if (steps > 0) options.fit.steps = steps;
        return owned(studio.fit(photo_of(rgb, height, width), options));
    });
}

int stymo_tune(const stymo_model* model, stymo_face* face, double seconds) {
    return guarded(-1, [&] {
        stymo::StudioFace tuned =
            given(model, "model").studio.tune(given(face, "face").face, seconds);
        *face = stymo_face(std::move(tuned));
        return 0;
    });
}

stymo_face* stymo_sample(const stymo_model* model, std::uint64_t seed, double truncation) {
    return guarded<stymo_face*>(
        nullptr, [&] { return owned(given(model, "model").studio.sample(seed, 0, truncation)); });
}

stymo_face* stymo_mix(const stymo_face* target, const stymo_face* source, const char* take) {
    return guarded<stymo_face*>(nullptr, [&] {
        return owned(stymo::mix(given(target, "target").face, given(source, "source").face,
                                &given(take, "take")));
    });
}

stymo_face* stymo_face_read(const stymo_model* model, const char* codes, const char* tuned) {
    return guarded<stymo_face*>(nullptr, [&] {
        return owned(
            given(model, "model").studio.read(&given(codes, "codes"), path_or_empty(tuned)));
    });
}

int stymo_face_write(const stymo_face* face, const char* codes, const char* tuned) {
    return guarded(-1, [&] {
        stymo::write(given(face, "face").face, &given(codes, "codes"), path_or_empty(tuned));
        return 0;
    });
}

const char* stymo_face_warnings(const stymo_face* face) {
    return guarded<const char*>(nullptr, [&] { return given(face, "face").warnings.c_str(); });
}

double stymo_face_psnr(const stymo_face* face) {
    constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    return guarded(unknown, [&] { return given(face, "face").face.psnr.value_or(unknown); });
}

int stymo_face_codes(const stymo_face* face, float codes[STYMO_CODE_SIZE]) {
    return guarded(-1, [&] {
        static_cast<void>(given(codes, "codes"));
        const stymo::Tensor row = joined(given(face, "face").face.face.codes).value();
        std::ranges::copy(row.values<float>(), codes);
        return 0;
    });
}

void stymo_face_free(stymo_face* face) {
    delete face;
}

int stymo_render(const stymo_model* model, const stymo_face* face, const double* angles, int side,
                 std::uint8_t* rgb) {
    return guarded(-1, [&] {
        static_cast<void>(given(rgb, "rgb"));
        stymo::StudioView view;
        if (side < 1) stymo::fail<stymo::ValueError>("a side of ", side, " pixels is empty");
        view.options.resolution = side;
        if (angles != nullptr) {
            view.yaw = angles[0];
            view.pitch = angles[1];
            view.roll = angles[2];
        }
        const stymo::View seen =
            given(model, "model").studio.render(given(face, "face").face, view);
        std::ranges::transform(seen.image.values<float>(), rgb, [](float value) {
            return static_cast<std::uint8_t>(std::clamp(value, 0.0F, 1.0F) * 255.0F + 0.5F);
        });
        return 0;
    });
}
