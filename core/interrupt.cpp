#include "core/interrupt.h"

#include <cstddef>

namespace stymo {
namespace {

volatile std::sig_atomic_t interrupt_flag = 0;

extern "C" void note_interrupt(int /*signal_number*/) {
    interrupt_flag = 1;
}

}  // namespace

InterruptGuard::InterruptGuard() {
    interrupt_flag = 0;
    struct sigaction action {};
    action.sa_handler = note_interrupt;
    // The default handler returns after the first signal, so that a second one ends a process that
    // never polls.
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    for (std::size_t i = 0; i < signals_.size(); ++i) sigaction(signals_[i], &action, &former_[i]);
}

InterruptGuard::~InterruptGuard() {
    for (std::size_t i = 0; i < signals_.size(); ++i) sigaction(signals_[i], &former_[i], nullptr);
}

bool interrupted() {
    return interrupt_flag != 0;
}

}  // namespace stymo
