#include "fuzz/request_readers.h"

#include "apps/view/request.h"
#include "nn/models/model.h"

namespace stymo::fuzz {

void read_request_body(const std::string& bytes) {
    const CameraConfig camera;
    each([&] { static_cast<void>(view::frame_query(bytes, camera)); },
         [&] { static_cast<void>(view::color_query(bytes, camera)); },
         [&] { static_cast<void>(view::face_query(bytes)); },
         [&] { static_cast<void>(view::film_query(bytes, camera)); },
         [&] {
             static_cast<void>(
                 view::Request{.path = {}, .query = {{"x", bytes}}}.number("x", 0.0, 0.0, 1.0));
         });
}

}  // namespace stymo::fuzz
