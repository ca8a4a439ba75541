add_library(stymo_options INTERFACE)
# GCC 12 reports its own AVX-512 intrinsics as maybe uninitialised.
target_compile_options(stymo_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor -Wold-style-cast -Wno-maybe-uninitialized
  -fno-math-errno -fno-trapping-math
  # GCC 12 sees overlapping copies in std::string where there are none (GCC bug 105651).
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
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
  target_compile_options(stymo_options INTERFACE -fsanitize=${STYMO_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(stymo_options INTERFACE -fsanitize=${STYMO_SANITIZE})
endif()
