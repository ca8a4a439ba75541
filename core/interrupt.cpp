#include "core/interrupt.h"

#include <atomic>
#include <cstddef>

namespace stymo {
namespace {

// Other threads than that of the handler poll the flag.
std::atomic<bool> interrupt_flag{false};
static_assert(std::atomic<bool>::is_always_lock_free);
std::atomic<int> guards{0};

extern "C" void note_interrupt(int /*signal_number*/) {
    interrupt_flag = true;
}

}  // namespace

InterruptGuard::InterruptGuard() {
    if (guards++ == 0) interrupt_flag = false;
    struct sigaction action {};
    action.sa_handler = note_interrupt;
    // The default handler returns after the first signal, so that a second one ends a process that
    // never polls.
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    for (std::size_t i = 0; i < signals_.size(); ++i) sigaction(signals_[i], &action, &former_[i]);
}

InterruptGuard::~InterruptGuard() {
    for (std::size_t i = 0; i < signals_.size(); ++i) sigaction(signals_[i], &former_[i], nullptr);
    --guards;
}

bool interrupted() {
    return interrupt_flag;
}

}  // namespace stymo
