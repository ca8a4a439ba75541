#pragma once

#include <dlfcn.h>

// The libraries of this folder stand in front of the C library (LD_PRELOAD) and pass calls on.

/// Declares `next`, the C library's function of the same name.
#define STYMO_NEXT(function)  \
    static auto* const next = \
        reinterpret_cast<decltype(&::function)>(::dlsym(RTLD_NEXT, #function))  // NOLINT
