// SPDX-License-Identifier: Apache-2.0

// Work on a scene's tables by two threads, while a case is opened.
#pragma once

#include <cstddef>
#include <exception>
#include <system_error>
#include <thread>

namespace sonocase::runtime {

// work(half, begin, end) for [0, count) in two parts, half 0 and 1. What is thrown comes out here.
template <class Work>
void parallel_halves(std::size_t count, const Work& work) {
#if !defined(__EMSCRIPTEN__) || defined(__EMSCRIPTEN_PTHREADS__)
    std::exception_ptr thrown;
    std::thread other;
    try {
        other = std::thread([&] {
            try {
                work(0, std::size_t{0}, count / 2);
            } catch (...) {
                thrown = std::current_exception();
            }
        });
    } catch (const std::system_error&) {  // no thread to be had
        work(0, std::size_t{0}, count / 2);
    }
    try {
        work(1, count / 2, count);
    } catch (...) {
        if (other.joinable()) other.join();
        throw;
    }
    if (other.joinable()) other.join();
    if (thrown) std::rethrow_exception(thrown);
#else
    work(0, std::size_t{0}, count / 2);
    work(1, count / 2, count);
#endif
}

}  // namespace sonocase::runtime
