#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "render/morphable/head.h"

namespace stymo {

/// The 52 blend shapes of Apple's ARKit, in the order of the columns of Live Link Face. Left is the
/// person's left.
inline constexpr std::array<const char*, 52> arkit_names{"eyeBlinkLeft",
                                                         "eyeLookDownLeft",
                                                         "eyeLookInLeft",
                                                         "eyeLookOutLeft",
                                                         "eyeLookUpLeft",
                                                         "eyeSquintLeft",
                                                         "eyeWideLeft",
                                                         "eyeBlinkRight",
                                                         "eyeLookDownRight",
                                                         "eyeLookInRight",
                                                         "eyeLookOutRight",
                                                         "eyeLookUpRight",
                                                         "eyeSquintRight",
                                                         "eyeWideRight",
                                                         "jawForward",
                                                         "jawRight",
                                                         "jawLeft",
                                                         "jawOpen",
                                                         "mouthClose",
                                                         "mouthFunnel",
                                                         "mouthPucker",
                                                         "mouthRight",
                                                         "mouthLeft",
                                                         "mouthSmileLeft",
                                                         "mouthSmileRight",
                                                         "mouthFrownLeft",
                                                         "mouthFrownRight",
                                                         "mouthDimpleLeft",
                                                         "mouthDimpleRight",
                                                         "mouthStretchLeft",
                                                         "mouthStretchRight",
                                                         "mouthRollLower",
                                                         "mouthRollUpper",
                                                         "mouthShrugLower",
                                                         "mouthShrugUpper",
                                                         "mouthPressLeft",
                                                         "mouthPressRight",
                                                         "mouthLowerDownLeft",
                                                         "mouthLowerDownRight",
                                                         "mouthUpperUpLeft",
                                                         "mouthUpperUpRight",
                                                         "browDownLeft",
                                                         "browDownRight",
                                                         "browInnerUp",
                                                         "browOuterUpLeft",
                                                         "browOuterUpRight",
                                                         "cheekPuff",
                                                         "cheekSquintLeft",
                                                         "cheekSquintRight",
                                                         "noseSneerLeft",
                                                         "noseSneerRight",
                                                         "tongueOut"};

enum class ArkitSource {
    exact,     ///< an expression of the head by that name
    composed,  ///< of others: a sum, an opposite or one half of an expression
    missing,   ///< the head cannot do it
};

/// "exact", "composed" or "missing".
[[nodiscard]] const char* name_of(ArkitSource source);

/// What a head can do of ARKit's shapes.
struct ArkitShapes {
    std::array<ArkitSource, arkit_names.size()> source{};
    /// The expressions with the codes that make a coefficient of 1: "1.5 eyeBlink_L + 2
    /// cheekSquint, left half"; empty where it is missing.
    std::array<std::string, arkit_names.size()> recipe;
    Tensor displacement;  ///< (52, V, 3) for coefficients of 1; zero where it is missing
};

/// For scans the expressions of the same names count, which may end in _L and _R (ICT-FaceKit); the
/// built-in head has a table. A head without names can do nothing.
[[nodiscard]] ArkitShapes arkit_shapes(const MorphableHead& head);

}  // namespace stymo
