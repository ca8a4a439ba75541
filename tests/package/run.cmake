# Installs the built library into an empty prefix, and builds and runs the program of this folder
# with it, once by find_package(stymo) and once by pkg-config. Expects BUILD_FOLDER, SOURCE_FOLDER
# and CXX; EXTRA_FLAGS may be empty.
set(work ${BUILD_FOLDER}/package_test)
set(prefix ${work}/prefix)
file(REMOVE_RECURSE ${work})

function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ECHO STDOUT COMMAND_ERROR_IS_FATAL ANY)
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD_FOLDER} --prefix ${prefix} --component development)
run(${CMAKE_COMMAND} --install ${BUILD_FOLDER} --prefix ${prefix} --component models)

# Every header of the library that an installed header includes is installed too.
file(GLOB_RECURSE headers ${prefix}/include/stymo/*.h)
foreach(header ${headers})
  file(STRINGS ${header} includes REGEX "^#include \"")
  foreach(include ${includes})
    string(REGEX REPLACE "^#include \"(.*)\".*" "\\1" include "${include}")
    if(NOT EXISTS ${prefix}/include/stymo/${include})
      message(SEND_ERROR "${header} includes ${include}, which is not installed")
    endif()
  endforeach()
endforeach()

# The C++ and the C example fit the same photo, a drawn face.
set(photo ${SOURCE_FOLDER}/../../docs/tutorial/drawn.png)
run(${CMAKE_COMMAND} -S ${SOURCE_FOLDER} -B ${work}/build -DCMAKE_PREFIX_PATH=${prefix}
  -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${EXTRA_FLAGS})
run(${CMAKE_COMMAND} --build ${work}/build)
run(${work}/build/consumer)
run(${work}/build/embed ${photo} ${work}/turned.png)
find_program(oiiotool oiiotool)
if(oiiotool)
  run(${oiiotool} ${photo} -o ${work}/photo.ppm)
  run(${work}/build/embed_c ${work}/photo.ppm ${work}/turned.ppm)
  # Both have rounded the same image.
  run(${oiiotool} --fail 0.004 ${work}/turned.png ${work}/turned.ppm --diff)
endif()

find_program(pkg_config pkg-config)
if(pkg_config)
  file(GLOB_RECURSE description ${prefix}/*/stymo.pc)
  execute_process(COMMAND ${pkg_config} --cflags --libs ${description} OUTPUT_VARIABLE flags
    OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags UNIX_COMMAND "${flags} ${EXTRA_FLAGS}")
  get_filename_component(library_folder ${description} DIRECTORY)
  run(${CXX} -std=c++20 ${SOURCE_FOLDER}/main.cpp -o ${work}/consumer ${flags}
    -Wl,-rpath,${library_folder}/..)
  run(${work}/consumer)
  execute_process(COMMAND ${pkg_config} --variable=configs ${description} OUTPUT_VARIABLE configs
    OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  if(NOT EXISTS ${configs}/models/faces-256/model.safetensors)
    message(SEND_ERROR "pkg-config's configs=${configs} has no model")
  endif()
endif()
