# Builds for 64-bit ARM with Debian's cross compiler. STYMO_SYSROOT is a folder with Debian's arm64
# libraries (tests/tools/arm64.sh).
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES STYMO_SYSROOT)

set(CMAKE_SYSROOT ${STYMO_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
# pkg-config of the building machine reads the files of the sysroot.
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${STYMO_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR}
  ${STYMO_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${STYMO_SYSROOT}/usr/share/pkgconfig)
