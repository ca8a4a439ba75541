# `cmake --install` installs the library, its headers, and the files of find_package(stymo) and
# pkg-config as the component "development", and the models as "models". apps/CMakeLists.txt
# installs the tools as "tools". `cpack` makes a Debian package of tools and models.
include(CMakePackageConfigHelpers)

set(stymo_cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/stymo)
set_target_properties(stymo PROPERTIES VERSION ${PROJECT_VERSION}
  SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})

install(TARGETS stymo stymo_c EXPORT stymoTargets COMPONENT development
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT stymoTargets NAMESPACE stymo:: DESTINATION ${stymo_cmake_folder}
  COMPONENT development)

# Headers of kernels are not installed, because they include Highway; nor are those that include
# them. tests/package looks for an installed header that needs one that is not.
set(private_headers kernels *_kernel.h packed_*.h colors.h image_rows.h block_step.h ray_tile.h
  rays_of_face.h)
list(TRANSFORM private_headers REPLACE "(.+)" "PATTERN;\\1;EXCLUDE" OUTPUT_VARIABLE excluded)
foreach(folder core nn render train fit)
  if(IS_DIRECTORY ${PROJECT_SOURCE_DIR}/${folder})
    install(DIRECTORY ${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/stymo COMPONENT development
      FILES_MATCHING PATTERN "*.h" ${excluded})
  endif()
endforeach()
if(IS_DIRECTORY ${PROJECT_SOURCE_DIR}/configs)
  install(DIRECTORY configs DESTINATION ${CMAKE_INSTALL_DATADIR}/stymo COMPONENT models
    FILES_MATCHING PATTERN "*.json" PATTERN "*.safetensors" PATTERN "README.md"
    PATTERN "LICENSE.*")
endif()

configure_package_config_file(cmake/stymoConfig.cmake.in ${PROJECT_BINARY_DIR}/stymoConfig.cmake
  INSTALL_DESTINATION ${stymo_cmake_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/stymoConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/stymoConfig.cmake ${PROJECT_BINARY_DIR}/stymoConfigVersion.cmake
  DESTINATION ${stymo_cmake_folder} COMPONENT development)

if(NOT BUILD_SHARED_LIBS)
  list(TRANSFORM stymo_opencv_components PREPEND -lopencv_
    OUTPUT_VARIABLE stymo_pkgconfig_libraries)
  list(JOIN stymo_pkgconfig_libraries " " stymo_pkgconfig_libraries)
  string(APPEND stymo_pkgconfig_libraries
    " -lOpenImageIO -lOpenImageIO_Util -lpng -ljpeg -lgif -lwebpmux -lwebp -llcms2 -lz -lzip"
    " -lavformat -lavcodec -lavutil -lhwy -lgomp")
  if(STYMO_WITH_DLIB)
    string(APPEND stymo_pkgconfig_libraries " -ldlib")
  endif()
endif()
file(RELATIVE_PATH stymo_prefix_from_pkgconfig /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(cmake/stymo.pc.in ${PROJECT_BINARY_DIR}/stymo.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/stymo.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
  COMPONENT development)

install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright COMPONENT tools)
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "stymo authors <stymo@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_COMPONENTS_ALL tools models)
set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
include(CPack)
