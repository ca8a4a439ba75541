#pragma once

#include <array>

namespace stymo {

/// The face parsing classes of CelebAMask-HQ, in its order.
enum class ParsingClass {
    background,
    skin,
    nose,
    eye_glasses,
    left_eye,
    right_eye,
    left_brow,
    right_brow,
    left_ear,
    right_ear,
    mouth,
    upper_lip,
    lower_lip,
    hair,
    hat,
    earring,
    necklace,
    neck,
    cloth
};
constexpr int parsing_class_count = 19;

/// The names of the classes in CelebAMask-HQ's files, in the order of `ParsingClass`.
inline constexpr std::array<const char*, parsing_class_count> parsing_class_names{
    "background", "skin",  "nose",  "eye_g", "l_eye", "r_eye", "l_brow", "r_brow", "l_ear", "r_ear",
    "mouth",      "u_lip", "l_lip", "hair",  "hat",   "ear_r", "neck_l", "neck",   "cloth"};

/// Whether a class of CelebAMask-HQ's parsing (0..18) belongs to the head: 1-13 and 15, all but
/// background, hat, neck and clothes.
[[nodiscard]] constexpr bool is_head_class(int index) {
    return (index >= 1 && index <= 13) || index == 15;
}

/// Whether a class belongs to the face: 1-7 and 10-12, the head without ears, hair and earrings.
[[nodiscard]] constexpr bool is_face_class(int index) {
    return (index >= 1 && index <= 7) || (index >= 10 && index <= 12);
}

}  // namespace stymo
