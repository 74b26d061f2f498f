// SPDX-License-Identifier: Apache-2.0

// Blocks of 4 MB and more on pages of 2 MB, for the programs that render: a probe that jumps reads
// from all over a bundle, and with pages of 4 kB most look-ups would miss the address cache (TLB).
// Loading causes fewer page faults too. Replaces the global operator new of the program that this
// file is linked into; smaller blocks come from the C library.
#include <algorithm>
#include <cstdlib>
#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace {

constexpr std::size_t kPage = std::size_t{2} << 20, kLarge = 2 * kPage;

void* allocate(std::size_t bytes) noexcept {
    if (bytes < kLarge) return std::malloc(std::max<std::size_t>(bytes, 1));
    const std::size_t whole = (bytes + kPage - 1) / kPage * kPage;
    if (whole < bytes) return nullptr;
    void* block = std::aligned_alloc(kPage, whole);
#ifdef __linux__
    // A system without such pages refuses, which is harmless.
    if (block != nullptr) (void)madvise(block, whole, MADV_HUGEPAGE);
#endif
    return block;
}

}  // namespace

void* operator new(std::size_t bytes) {
    for (;;) {
        if (void* block = allocate(bytes)) return block;
        const std::new_handler handler = std::get_new_handler();
        if (handler == nullptr) throw std::bad_alloc();
        handler();
    }
}
void operator delete(void* block) noexcept {
    std::free(block);
}
void operator delete(void* block, std::size_t) noexcept {
    std::free(block);
}
