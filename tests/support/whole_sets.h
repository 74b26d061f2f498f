// SPDX-License-Identifier: Apache-2.0

// Sets of bodies, sweeps, seeds and machines of which every change tries some, always the same
// ones, and a release tries all: scripts/test whole, which sets SONOCASE_WHOLE.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <tuple>
#include <vector>

namespace sonocase::testing {

inline bool whole_sets() {
    return std::getenv("SONOCASE_WHOLE") != nullptr;
}

// Every other pair of a first and a second, as the black squares of a chessboard: half of the
// seconds for each first.
template <typename A, typename B>
std::vector<std::tuple<A, B>> half_of_pairs(const std::vector<A>& first,
                                            const std::vector<B>& second) {
    std::vector<std::tuple<A, B>> pairs;
    for (std::size_t i = 0; i < first.size(); ++i)
        for (std::size_t j = 0; j < second.size(); ++j)
            if (whole_sets() || (i + j) % 2 == 0) pairs.emplace_back(first[i], second[j]);
    return pairs;
}

template <typename T>
std::vector<T> half_of(const std::vector<T>& all) {
    std::vector<T> some;
    for (std::size_t i = 0; i < all.size(); ++i)
        if (whole_sets() || i % 2 == 0) some.push_back(all[i]);
    return some;
}

// Pictures that the slow renderer draws as well: with sanitizers it takes most of the time, and
// half of them go through the same code.
template <typename T>
std::vector<T> half_with_sanitizers(const std::vector<T>& all) {
#ifdef __SANITIZE_ADDRESS__
    return half_of(all);
#else
    return all;
#endif
}

}  // namespace sonocase::testing
