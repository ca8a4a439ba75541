add_library(stymo_options INTERFACE)
target_compile_options(stymo_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor
  -Wold-style-cast
  -fno-math-errno -fno-trapping-math -fopenmp-simd
  # False alarms of GCC 12: its own AVX-512 intrinsics, which Eigen uses, and std::string (GCC bug
  # 105651).
  $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized -Wno-restrict -Wno-uninitialized>
  # GCC collects its garbage from 128 MiB on; that takes a tenth of the time of a compilation.
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1000000>
  # Clang warns of each loop that it does not vectorise, which is no fault. Where files are compiled
  # together, it warns of local names that another file has in its anonymous namespace.
  $<$<CXX_COMPILER_ID:Clang>:-Wno-pass-failed>
  $<$<AND:$<BOOL:${CMAKE_UNITY_BUILD}>,$<CXX_COMPILER_ID:Clang>>:-Wno-shadow>
  $<$<BOOL:${STYMO_WERROR}>:-Werror>
  $<$<BOOL:${STYMO_NATIVE}>:-march=native>)
# Full-width vectors: the compiler's default prefers 256 bits on processors that have 512.
if(STYMO_NATIVE)
  include(CheckCXXCompilerFlag)
  check_cxx_compiler_flag(-mprefer-vector-width=512 STYMO_HAS_VECTOR_WIDTH)
  if(STYMO_HAS_VECTOR_WIDTH)
    target_compile_options(stymo_options INTERFACE -mprefer-vector-width=512)
  endif()
endif()
if(STYMO_SANITIZE)
  target_compile_options(stymo_options INTERFACE
    -fsanitize=${STYMO_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(stymo_options INTERFACE -fsanitize=${STYMO_SANITIZE})
endif()
if(STYMO_FUZZ)
  set(computing ${CMAKE_CURRENT_SOURCE_DIR}/tests/fuzz/computing.txt)
  target_compile_options(stymo_options INTERFACE
    -fsanitize-coverage-ignorelist=${computing} -fsanitize-ignorelist=${computing})
endif()
