#include "runtime/imaging/read_ahead.h"

#include <system_error>

namespace sonocase::runtime {
namespace {

// How far round the plane, nearest first. The last is where a probe that is slid at 100 mm/s, or
// turned at 40 degrees/s and looked at in 150 mm depth, comes to in a third of a second.
constexpr double kAheadMm[] = {8, 20, 35};

// A bundle that unpacks to more is read no further than the first, or it would all come to lie in
// memory where a frame needs little of it.
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

void ReadAhead::round(const ScanReach& reach, const Rigid& volume_from_probe) noexcept {
    if (blocks_.whole()) return;
    {
        const std::scoped_lock lock(mutex_);
        reach_ = &reach;
        volume_from_probe_ = volume_from_probe;
        news_ = true;
    }
    wake_.notify_one();
}

void ReadAhead::run() noexcept {
    for (;;) {
        const ScanReach* reach;
        Rigid volume_from_probe;
        {
            std::unique_lock lock(mutex_);
            wake_.wait(lock, [this] { return news_ || stop_; });
            if (stop_ || blocks_.whole()) return;
            reach = reach_;
            volume_from_probe = volume_from_probe_;
            news_ = false;
        }
        for (const double ahead_mm : kAheadMm) {
            if (ahead_mm > kAheadMm[0] && blocks_.pool_bytes() > kSmallBytes) break;
            reach->need(blocks_, grid_, volume_from_probe, ahead_mm,
                          [this] { return news_ || stop_; });
        }
    }
}

}  // namespace sonocase::runtime
