#include "fit/morphable/morphable_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/error.h"
#include "core/parallel.h"
#include "fit/morphable/landmark_term.h"
#include "fit/morphable/pixel_term.h"
#include "fit/morphable/state.h"
#include "fit/morphable/vertex_table.h"
#include "render/spherical_harmonics.h"

namespace stymo {

namespace {

using morphable::Contour;
using morphable::NormalEquations;
using morphable::State;
using morphable::VertexTable;

/// The head and its tables, which all photos share.
struct FittedHead {
    const MorphableHead* head;
    Contour contour;
    VertexTable face;
    std::vector<bool> non_negative;
};

void check(const MorphableFitTarget& target) {
    const Tensor& image = target.image;
    if (image.rank() != 3 || image.shape(0) != image.shape(1) || image.shape(2) != 3 ||
        image.size() == 0)
        fail<ShapeError>("[morphable fit] needs square images (S, S, 3); got ", image.shape());
    const Tensor& mask = target.mask;
    if (mask.defined() && !(mask.shape() == Shape{image.shape(0), image.shape(1), 1}))
        fail<ShapeError>("[morphable fit] the mask is ", mask.shape(), ", the image ",
                         image.shape());
    for (const Eigen::Vector2d& point : target.landmarks) {
        if (!point.allFinite()) fail<ValueError>("[morphable fit] a landmark is not finite");
    }
    const std::size_t known = target.identity.size();
    if (known != 0 && known != MorphableHead::identity_size)
        fail<ShapeError>("[morphable fit] an identity has ", MorphableHead::identity_size,
                         " numbers; got ", known);
}

/// Whether each landmark lies on an unknown pixel.
std::array<bool, 68> guessed_landmarks(const MorphableFitTarget& target) {
    std::array<bool, 68> guessed{};
    const std::int64_t side = target.image.shape(0);
    const auto at = [&](double coordinate) {
        return std::clamp<std::int64_t>(static_cast<std::int64_t>(coordinate), 0, side - 1);
    };
    for (std::size_t k = 0; target.known.defined() && k < guessed.size(); ++k) {
        const Eigen::Vector2d& point = target.landmarks[k];
        const std::int64_t pixel = at(point.y()) * side + at(point.x());
        guessed[k] = target.known.values<float>()[static_cast<std::size_t>(pixel)] == 0.0F;
    }
    return guessed;
}

/// The prior: codes are standard normal, and the light is close to white ambient light.
void add_prior(NormalEquations& equations, const State& state) {
    constexpr double light_deviation = 0.3;
    constexpr double tint_deviation = 0.05;
    const std::array<double, 1> one{1.0};
    for (std::size_t i = morphable::identity_begin; i < morphable::light_begin; ++i)
        equations.add(one, i, state[i], 1.0);
    const std::array<float, 27> neutral = neutral_light();
    for (std::size_t band = 0; band < 9; ++band) {
        const std::size_t first = morphable::light_begin + 3 * band;
        for (std::size_t channel = 0; channel < 3; ++channel) {
            equations.add(one, first + channel,
                          state[first + channel] - static_cast<double>(neutral[3 * band + channel]),
                          1.0 / (light_deviation * light_deviation));
            std::array<double, 3> difference{-1.0 / 3.0, -1.0 / 3.0, -1.0 / 3.0};
            difference[channel] += 1.0;
            double tint = 0.0;
            for (std::size_t k = 0; k < 3; ++k) tint += difference[k] * state[first + k];
            equations.add(difference, first, tint, 1.0 / (tint_deviation * tint_deviation));
        }
    }
}

/// Minimises the prior, the landmark term and, if there is one, the pixel term over the unknowns
/// [first, last) except those of a known identity.
[[nodiscard]] State minimized(State state, std::size_t first, std::size_t last, int steps,
                              bool knows_identity, const FittedHead& fitted,
                              morphable::LandmarkTerm& landmarks,
                              std::optional<morphable::PixelTerm>& pixels) {
    morphable::LeastSquaresProblem problem;
    problem.fixed.assign(morphable::state_size, true);
    std::fill(problem.fixed.begin() + static_cast<std::ptrdiff_t>(first),
              problem.fixed.begin() + static_cast<std::ptrdiff_t>(last), false);
    if (knows_identity)
        std::fill(problem.fixed.begin() + morphable::identity_begin,
                  problem.fixed.begin() + morphable::expression_begin, true);
    problem.non_negative = fitted.non_negative;
    problem.linearized = [&](std::span<const double> x) {
        NormalEquations equations(morphable::state_size);
        landmarks.hold(x);
        landmarks.add_to(equations, x);
        if (pixels) {
            pixels->hold(x);
            pixels->add_to(equations, x);
        }
        add_prior(equations, State(x.begin(), x.end()));
        return equations;
    };
    problem.cost = [&](std::span<const double> x) {
        NormalEquations prior(morphable::state_size);
        add_prior(prior, State(x.begin(), x.end()));
        return prior.cost + landmarks.cost(x) + (pixels ? pixels->cost(x) : 0.0);
    };
    return morphable::minimized(problem, std::move(state), steps);
}

[[nodiscard]] MorphableFit fit_one(const FittedHead& fitted, const MorphableFitTarget& target,
                                   const Intrinsics& intrinsics,
                                   const MorphableFitOptions& options) {
    const auto side = static_cast<double>(target.image.shape(0));
    const Landmarks given = scaled_landmarks(target.landmarks, 1.0 / side);
    State state(morphable::state_size, 0.0);
    std::ranges::copy(morphable::affine_pose(fitted.contour, given, intrinsics), state.begin());
    std::ranges::copy(neutral_light(), state.begin() + morphable::light_begin);
    std::ranges::copy(target.identity, state.begin() + morphable::identity_begin);

    const std::array<bool, 68> guessed = guessed_landmarks(target);
    morphable::LandmarkTerm landmarks(fitted.contour, given, intrinsics, options, guessed);
    std::optional<morphable::PixelTerm> pixels;
    const auto minimize = [&](std::size_t first, std::size_t last, int steps) {
        state = minimized(std::move(state), first, last, steps, !target.identity.empty(), fitted,
                          landmarks, pixels);
    };
    landmarks.use_jaw(false);
    minimize(0, morphable::pose_size, 5);
    landmarks.use_jaw(true);
    minimize(0, morphable::texture_begin, options.landmark_steps);
    if (options.pixels) {
        pixels.emplace(*fitted.head, fitted.face, target, intrinsics, options);
        minimize(morphable::texture_begin, morphable::state_size, 2);
        minimize(0, morphable::state_size, options.pixel_steps);
    }
    MorphableFit fit{morphable::pose_of(state),
                     morphable::code_of(state, morphable::identity_begin, 100),
                     morphable::code_of(state, morphable::expression_begin, 79),
                     morphable::code_of(state, morphable::texture_begin, 100),
                     morphable::code_of(state, morphable::light_begin, 27),
                     0.0};
    landmarks.hold(state);
    const Landmarks found = landmarks.fitted(state);
    double sum = 0.0, count = 0.0;
    for (std::size_t k = 0; k < found.size(); ++k) {
        if (guessed[k]) continue;
        sum += (found[k] - given[k]).squaredNorm();
        count += 1.0;
    }
    fit.landmark_error = std::sqrt(sum / std::max(count, 1.0));
    return fit;
}

}  // namespace

std::vector<MorphableFit> fit_morphable(const MorphableHead& head,
                                        std::span<const MorphableFitTarget> targets,
                                        const Intrinsics& intrinsics,
                                        const MorphableFitOptions& options) {
    for (const MorphableFitTarget& target : targets) check(target);
    FittedHead fitted{&head, Contour(head),
                      VertexTable(head, options.pixels ? morphable::face_vertices(head)
                                                       : std::vector<std::int32_t>{}),
                      std::vector<bool>(morphable::state_size, false)};
    std::copy(head.one_sided.begin(), head.one_sided.end(),
              fitted.non_negative.begin() + morphable::expression_begin);
    std::vector<MorphableFit> fits(targets.size());
    parallel_items(std::ssize(fits), [&](std::size_t i, int /*thread*/) {
        fits[i] = fit_one(fitted, targets[i], intrinsics, options);
    });
    return fits;
}

}  // namespace stymo
