#include <nanobind/ndarray.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "apps/python/module.h"
#include "core/angle.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"
#include "render/soft_edge.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace stymo::python {

namespace {

using Path = std::filesystem::path;
using OptionalPath = std::optional<Path>;
using Angle = std::optional<double>;

/// Calls `progress(stage, step, loss)`, and ends the job on Ctrl-C. The caller holds `progress`:
/// the observer is copied without Python's lock.
FitObserver observer_of(nb::handle progress) {
    const auto report = [progress](const char* stage, std::int64_t step, double loss) {
        const nb::gil_scoped_acquire locked;
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        if (!progress.is_none()) progress(stage, step, loss);
    };
    return {
        .on_fit_step = [=](const FitStep& step) { report("fit", step.steps, step.loss); },
        .on_fitted = {},
        .on_tuning_step = [=](const TuningStep& step) { report("tune", step.steps, step.loss); }};
}

StudioFace face_of(const Studio& studio, nb::handle given) {
    if (nb::isinstance<StudioFace>(given)) return nb::cast<StudioFace>(given);
    const Tensor codes = tensor_of(given, "codes");
    if (codes.shape() != Shape{code_size})
        fail<ValueError>("codes: the shape is ", codes.shape(), "; give (", code_size, ")");
    return {.face = {.codes = split_codes(codes.to(DType::float32).reshaped({1, code_size})),
                     .pose = frontal_pose(studio.model().config().camera)}};
}

RenderMode mode_of(const std::string& name) {
    const auto found = std::ranges::find(render_modes(), name, &RenderModeTraits::name);
    if (found == render_modes().end())
        fail<ValueError>("mode: \"", name, "\" is no mode; give \"exact\" or \"skip\"");
    return found->mode;
}

StudioFace fit(const Studio& studio, nb::handle image, std::int64_t steps, double tune,
               const std::string& optimizer, nb::handle progress) {
    const Tensor photo = photo_of(image);
    if (steps < 0 || !(tune >= 0.0)) fail<ValueError>("steps and tune must not be negative");
    if (optimizer != "adam" && optimizer != "lbfgs")
        fail<ValueError>("optimizer: \"", optimizer, "\" is none; give \"adam\" or \"lbfgs\"");
    FitJobOptions options = studio.fit_options();
    options.fit.steps = steps;
    options.fit.optimizer = optimizer == "adam" ? FitOptimizer::adam : FitOptimizer::lbfgs;
    options.tuning.seconds = tune;
    const FitObserver observer = observer_of(progress);
    const nb::gil_scoped_release unlocked;
    return studio.fit(photo, options, observer);
}

StudioFace tune(const Studio& studio, const StudioFace& face, double seconds, std::int64_t steps,
                nb::handle progress) {
    const FitObserver observer = observer_of(progress);
    const nb::gil_scoped_release unlocked;
    return studio.tune(face, seconds, steps, observer);
}

nb::object render(const Studio& studio, nb::handle given, Angle yaw, Angle pitch, Angle roll,
                  std::int64_t size, const std::string& mode, std::int64_t samples, bool cutout,
                  bool raw) {
    const StudioFace face = face_of(studio, given);
    const StudioView view{.yaw = yaw,
                          .pitch = pitch,
                          .roll = roll,
                          .options = {.mode = mode_of(mode),
                                      .samples_per_ray = samples,
                                      .resolution = size,
                                      .mask = cutout},
                          .raw = raw || cutout};
    Tensor image;
    {
        const nb::gil_scoped_release unlocked;
        const View seen = studio.render(face, view);
        image = seen.image;
        if (cutout) {
            const Tensor opacity = raw ? seen.mask : soft_opacity(seen.mask);
            image = concat({Variable(image), Variable(opacity)}, 2).value();
        }
    }
    return numpy_of(image);
}

std::vector<StudioFace> sample(const Studio& studio, int count, std::uint64_t seed,
                               double truncation) {
    std::vector<StudioFace> faces;
    for (int i = 0; i < count; ++i)
        faces.push_back(studio.sample(seed, static_cast<std::uint64_t>(i), truncation));
    return faces;
}

nb::dict pose_of(const StudioFace& face) {
    const Pose& pose = face.face.pose;
    nb::dict result;
    result["yaw"] = degrees_from_radians(pose.yaw);
    result["pitch"] = degrees_from_radians(pose.pitch);
    result["roll"] = degrees_from_radians(pose.roll);
    result["position"] =
        nb::make_tuple(pose.translation.x(), pose.translation.y(), pose.translation.z());
    return result;
}

FaceMesh mesh(const Studio& studio, nb::handle given, std::int64_t texture, bool neutral) {
    const StudioFace face = face_of(studio, given);
    const nb::gil_scoped_release unlocked;
    return studio.mesh(face, texture, neutral);
}

nb::object in_metres(const Tensor& positions) {
    return numpy_of(affine(positions, double{metres}, 0.0).value());
}

nb::dict shapes_of(const FaceMesh& mesh) {
    const nb::object targets = in_metres(mesh.targets);
    nb::dict shapes;
    for (std::size_t k = 0; k < arkit_names.size(); ++k)
        if (mesh.shapes.source[k] != ArkitSource::missing) shapes[arkit_names[k]] = targets[k];
    return shapes;
}

void bind_mesh(nb::module_& module) {
    nb::class_<FaceMesh>(module, "Mesh",
                         "A face as a textured mesh of M vertices and T triangles, with the "
                         "topology of the built-in head: in metres, y up, looking along +z. "
                         "Arrays are read-only.")
        .def_prop_ro(
            "vertices", [](const FaceMesh& mesh) { return in_metres(mesh.surface.vertices); },
            nb::sig("def vertices(self) -> numpy.typing.NDArray[numpy.float32]"),
            "(M, 3), in metres.")
        .def_prop_ro(
            "normals", [](const FaceMesh& mesh) { return numpy_of(mesh.surface.normals); },
            nb::sig("def normals(self) -> numpy.typing.NDArray[numpy.float32]"),
            "(M, 3), of length 1.")
        .def_prop_ro(
            "faces",
            [](const FaceMesh& mesh) {
                const auto& triangles = mesh.surface.triangles;
                return nb::ndarray<nb::numpy, const std::int32_t, nb::shape<-1, 3>>(
                    triangles.front().data(), {triangles.size(), 3}, nb::find(mesh));
            },
            nb::sig("def faces(self) -> numpy.typing.NDArray[numpy.int32]"),
            "(T, 3), indices of vertices, counter-clockwise seen from outside.")
        .def_prop_ro(
            "uv", [](const FaceMesh& mesh) { return numpy_of(mesh.surface.uv); },
            nb::sig("def uv(self) -> numpy.typing.NDArray[numpy.float32]"),
            "(M, 2), in [0, 1], v downwards.")
        .def_prop_ro(
            "texture", [](const FaceMesh& mesh) { return numpy_of(mesh.surface.texture); },
            nb::sig("def texture(self) -> numpy.typing.NDArray[numpy.float32]"),
            "(S, S, 3), in [0, 1].")
        .def_prop_ro("shapes", &shapes_of,
                     nb::sig("def shapes(self) -> dict[str, "
                             "numpy.typing.NDArray[numpy.float32]]"),
                     "ARKit's blend shapes by name, without those that the head cannot do: "
                     "displacements (M, 3) in metres for a coefficient of 1.");
}

void bind_face(nb::module_& module) {
    nb::class_<StudioFace>(module, "Face",
                           "A face as a model knows it: codes, pose and, if it is tuned, a "
                           "decoder of its own.")
        .def_prop_ro(
            "codes",
            [](const StudioFace& face) {
                return numpy_of(joined(face.face.codes).value().reshaped({code_size}));
            },
            nb::sig("def codes(self) -> numpy.typing.NDArray[numpy.float32]"),
            "(306,), read-only: identity 100, expression 79, texture 100, light 27 "
            "(stymo.GROUPS).")
        .def_prop_ro("pose", &pose_of,
                     "The camera: yaw, pitch and roll in degrees, position in decimetres.")
        .def_prop_ro(
            "psnr", [](const StudioFace& face) { return face.psnr; },
            "Of the rendered face against its photo, in decibels; None unless fitted.")
        .def_prop_ro(
            "tuned", [](const StudioFace& face) { return face.tuned != nullptr; },
            "Whether the face has a decoder of its own.")
        .def_ro("warnings", &StudioFace::warnings, "One line each.")
        .def(
            "write",
            [](const StudioFace& face, const Path& codes, const OptionalPath& tuned) {
                write(face, codes, tuned.value_or(Path()));
            },
            "codes"_a, "tuned"_a = nb::none(),
            "Writes codes.json and, for a tuned face, tuned.safetensors, for the tools.");
}

void bind_fits(nb::class_<Studio>& model) {
    model
        .def_static(
            "load",
            [](const OptionalPath& path) {
                const nb::gil_scoped_release unlocked;
                return Studio(path.value_or(Path()));
            },
            "path"_a = nb::none(),
            "Reads a model's file, or \"faces-512\", the model for 512 pixels that comes with "
            "stymo; without a path that for 256 pixels.")
        .def_prop_ro(
            "side", [](const Studio& studio) { return studio.model().config().decoder.resolution; },
            "Side of the model's images in pixels.")
        .def("fit", &fit, "image"_a, "steps"_a = 200, "tune"_a = 0.0, "optimizer"_a = "adam",
             "progress"_a = nb::none(),
             nb::sig("def fit(self, image: numpy.typing.ArrayLike, steps: int = 200, tune: float "
                     "= 0.0, optimizer: str = 'adam', progress: "
                     "collections.abc.Callable[[str, int, float], object] | None = None) -> Face"),
             "Finds the clearest face of a photo and fits codes to it.\n\n"
             "image: (height, width, 3), uint8, or floats in [0, 1], which are not copied.\n"
             "tune: also tunes the decoder to the photo for so many seconds.\n"
             "progress: called with the stage (\"fit\", \"tune\"), the step and its loss.")
        .def("tune", &tune, "face"_a, "seconds"_a = 20.0, "steps"_a = 0, "progress"_a = nb::none(),
             nb::sig("def tune(self, face: Face, seconds: float = 20.0, steps: int = 0, progress: "
                     "collections.abc.Callable[[str, int, float], object] | None = None) -> Face"),
             "Tunes the decoder to the photo of a face that `fit` returned, until the seconds or "
             "the steps are over; 0: no such limit.")
        .def(
            "mix",
            [](const Studio&, const StudioFace& target, const StudioFace& source,
               const std::string& take) { return mix(target, source, take); },
            "target"_a, "source"_a, "take"_a,
            "The target with groups of the source's codes: \"id\", \"expr\", \"tex\", \"light\", "
            "joined by commas.")
        .def(
            "read",
            [](const Studio& studio, const Path& codes, const OptionalPath& tuned) {
                return studio.read(codes, tuned.value_or(Path()));
            },
            "codes"_a, "tuned"_a = nb::none(),
            "Reads codes.json and tuned.safetensors of `Face.write` or stymo-fit.");
}

void bind_views(nb::class_<Studio>& model) {
    model
        .def("render", &render, "face"_a, "yaw"_a = nb::none(), "pitch"_a = nb::none(),
             "roll"_a = nb::none(), "size"_a = 0, "mode"_a = "exact", "samples"_a = 64,
             "cutout"_a = false, "raw"_a = false,
             nb::sig("def render(self, face: Face | numpy.typing.ArrayLike, yaw: float | None = "
                     "None, pitch: float | None = None, roll: float | None = None, size: int = 0, "
                     "mode: str = 'exact', samples: int = 64, cutout: bool = False, raw: bool = "
                     "False) -> numpy.typing.NDArray[numpy.float32]"),
             "Renders a face, or codes (306,): (size, size, 3), float32 in [0, 1], read-only.\n\n"
             "yaw, pitch, roll: degrees; without any, the face's own pose.\n"
             "size: 64, 128, 256 ... pixels; 0: the model's.\n"
             "mode: \"exact\", or \"skip\", which is faster and keeps about 45 dB.\n"
             "cutout: a fourth channel is the head's opacity, and the colours do not fade.\n"
             "raw: what the decoder draws, without the soft edge beyond which a head fades to "
             "black.")
        .def("mesh", &mesh, "face"_a, "texture"_a = 1024, "neutral"_a = false,
             nb::sig("def mesh(self, face: Face | numpy.typing.ArrayLike, texture: int = 1024, "
                     "neutral: bool = False) -> Mesh"),
             "A face, or codes (306,), as a textured mesh with ARKit's blend shapes.\n\n"
             "texture: its side in pixels, a power of two.\n"
             "neutral: without the expression of the face; otherwise the blend shapes come on "
             "top of it.")
        .def("sample", &sample, "count"_a = 1, "seed"_a = 0, "truncation"_a = 0.7,
             "New faces from the distribution of the training faces. truncation: 0 gives the "
             "mean face, 1 faces as varied as those.");
}

}  // namespace

void bind_model(nb::module_& module) {
    bind_mesh(module);
    bind_face(module);
    nb::class_<Studio> model(module, "Model",
                             "A face model with all that leads from a photo to a rendered face. "
                             "Long calls release the GIL, and threads may share it.");
    bind_fits(model);
    bind_views(model);
    bind_decoder(model);
}

}  // namespace stymo::python
