#pragma once

namespace stymo {

/// Makes waiting OpenMP threads spin only for some microseconds before they sleep, unless the
/// environment sets another policy (docs/decisions.md). GNU's OpenMP reads its policy before
/// `main`, so the program executes itself again with GOMP_SPINCOUNT set, which takes as long as
/// loading its libraries. If that fails, or if the program is only asked for help, it continues
/// without. `argv` is that of `main`.
void shorten_spinning(char** argv);

}  // namespace stymo
