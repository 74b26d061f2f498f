// SPDX-License-Identifier: Apache-2.0

// Loops of independent sums and minima, compiled for the widest instructions of the machine that
// runs them. Each value is computed by the same additions in the same order, without fused
// multiply-add: the results do not depend on the width.
#pragma once

// Sanitizers run before the choice is made, and clang chooses in another way.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SONOCASE_WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SONOCASE_WIDEST
#endif
