// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/read_ahead.h"

#include <system_error>

namespace sonocase::runtime {
namespace {

// How far round the plane after what the frame reads, nearest first. The last is where a probe that
// is slid at 100 mm/s, or turned at 40 degrees/s and looked at in 150 mm depth, comes to in a third
// of a second.
constexpr double kAheadMm[] = {0, 8, 20, 35};

// A bundle that unpacks to more is read no further than the first step, or it would all come to lie
// in memory where a frame needs little of it.
constexpr std::size_t kSmallBytes = std::size_t{200} << 20;

}  // namespace

ReadAhead::ReadAhead(VoxelBlocks& blocks, const Grid& grid) : blocks_(blocks), grid_(grid) {
    try {
        thread_ = std::thread([this] { run(); });
    } catch (const std::system_error&) {
    }
}

ReadAhead::~ReadAhead() {
    {
        const std::scoped_lock lock(mutex_);
        stop_ = true;
    }
    wake_.notify_one();
    if (thread_.joinable()) thread_.join();
}

void ReadAhead::frame(const ScanReach& reach,
                      const Rigid& volume_from_probe,
                      double shift_mm) noexcept {
    if (blocks_.whole()) return;
    {
        const std::scoped_lock lock(mutex_);
        reach_ = &reach;
        volume_from_probe_ = volume_from_probe;
        shift_mm_ = shift_mm;
        news_ = true;
    }
    wake_.notify_one();
}

void ReadAhead::run() noexcept {
    for (;;) {
        const ScanReach* reach;
        Rigid volume_from_probe;
        double shift_mm;
        {
            std::unique_lock lock(mutex_);
            wake_.wait(lock, [this] { return news_ || stop_; });
            if (stop_ || blocks_.whole()) return;
            reach = reach_;
            volume_from_probe = volume_from_probe_;
            shift_mm = shift_mm_;
            news_ = false;
        }
        for (const double ahead_mm : kAheadMm) {
            if (ahead_mm > kAheadMm[1] && blocks_.pool_bytes() > kSmallBytes) break;
            reach->ensure_loaded_backwards(blocks_, grid_, volume_from_probe, shift_mm + ahead_mm,
                                           [this] { return news_ || stop_; });
        }
    }
}

}  // namespace sonocase::runtime
