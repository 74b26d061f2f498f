// SPDX-License-Identifier: Apache-2.0

// The name that a typo most likely meant, for errors of recipes, exercises and command lines.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase {

// Number of single-character insertions, deletions, replacements and swaps of neighbours that turn
// a into b (optimal string alignment). O(|a| |b|) time, O(|b|) memory.
int edit_distance(std::string_view a, std::string_view b);

// The candidate nearest to `name`; of several the first. Empty when even the nearest is not a
// likely typo: more edits away than a third of the longer name's length (one edit is always near
// enough).
std::string nearest_name(std::string_view name, std::span<const std::string> candidates);

// "did you mean 'x'?" or, without a near name, "valid here: a, b, c".
std::string suggest_name(std::string_view name, std::span<const std::string> candidates);

// The first word of a command line that looks like an option and is none of `known` ("--labels"):
// "--lables is no option; did you mean --labels?", else empty. A parser names what is missing
// first, which helps nobody who mistyped its name.
std::string unknown_option(std::span<const std::string> words, std::span<const std::string> known);

}  // namespace sonocase
