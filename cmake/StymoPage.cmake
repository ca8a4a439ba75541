# Makes the files of a folder a part of a target, as the function page_file of
# apps/view/page_files.h.
function(stymo_embed_page target folder)
  file(GLOB files CONFIGURE_DEPENDS ${folder}/*)
  set(entries)
  foreach(file ${files})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
    cmake_path(GET file FILENAME name)
    file(READ ${file} text)
    string(APPEND entries "    {\"${name}\", R\"page(${text})page\"},\n")
  endforeach()
  set(source ${CMAKE_CURRENT_BINARY_DIR}/page_files.cpp)
  file(CONFIGURE OUTPUT ${source} @ONLY CONTENT "#include \"apps/view/page_files.h\"

#include <algorithm>
#include <array>

namespace stymo::view {

std::optional<PageFile> page_file(const std::string& name) {
    static constexpr auto files = std::to_array<PageFile>({
@entries@    });
    const auto found = std::ranges::find(files, name, &PageFile::name);
    if (found == files.end()) return std::nullopt;
    return *found;
}

}  // namespace stymo::view
")
  target_sources(${target} PRIVATE ${source})
  set_property(SOURCE ${source} PROPERTY SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()
