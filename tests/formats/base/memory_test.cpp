// SPDX-License-Identifier: Apache-2.0

#include "formats/base/memory.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace sonocase {
namespace {

TEST(Memory, SmallRequestsCanBeMet) {
    EXPECT_TRUE(can_allocate(0));
    EXPECT_TRUE(can_allocate(std::size_t{100} << 20));
}

// The address sanitizer ends a program that asks for that much.
#if !defined(__SANITIZE_ADDRESS__)
TEST(Memory, WhatNoMachineHasIsRefusedWithoutAnException) {
    EXPECT_FALSE(can_allocate(SIZE_MAX / 4));
}
#endif

}  // namespace
}  // namespace sonocase
