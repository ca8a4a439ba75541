#pragma once

namespace stymo {

/// Makes OpenMP's waiting threads spin for some microseconds only before they sleep, unless the
/// environment says otherwise (docs/decisions.md). GNU's OpenMP reads its policy before `main`, so
/// the program starts itself again with GOMP_SPINCOUNT set, which takes as long as loading its
/// libraries. It goes on as it is where that fails and where it is only asked for help. `argv` as
/// `main` has it.
void shorten_spinning(char** argv);

}  // namespace stymo
