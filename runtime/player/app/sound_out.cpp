// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/sound_out.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <dlfcn.h>

#include "formats/base/constants.h"

namespace sonocase::runtime::inline player_app {

namespace {

// A note that swells and dies away, so that it does not click.
void add_note(std::vector<float>& pairs, double hz, double seconds) {
    const int count = static_cast<int>(kToneHz * seconds);
    for (int i = 0; i < count; ++i) {
        const double t = double(i) / count, swell = std::sin(kPi * t);
        const auto v =
            static_cast<float>(0.3 * swell * swell * std::sin(2 * kPi * hz * i / kToneHz));
        pairs.push_back(v);
        pairs.push_back(v);
    }
}

}  // namespace

std::vector<float> tone(Tone what) {
    std::vector<float> pairs;
    if (what == Tone::target) {
        add_note(pairs, 660, 0.1);
        add_note(pairs, 880, 0.12);
    } else {
        add_note(pairs, 196, 0.3);
    }
    return pairs;
}

namespace {

constexpr unsigned kRate = static_cast<unsigned>(kToneHz);
constexpr std::size_t kBlock = 240;         // pairs handed over at once: 10 ms
constexpr unsigned kDeviceDelayUs = 60000;  // that the device may hold

// Constants of <alsa/pcm.h>, whose values belong to the library's binary interface.
constexpr int kPlayback = 0, kSigned16 = 2, kInterleaved = 3;

// Replaces the library's own printing: the program says in one line what is wrong.
void say_nothing(const char*, int, const char*, int, const char*, ...) {}

}  // namespace

struct SoundOut::Alsa {
    void* library = nullptr;
    void* pcm = nullptr;
    int (*close)(void*) = nullptr;
    long (*writei)(void*, const void*, unsigned long) = nullptr;
    int (*recover)(void*, int, int) = nullptr;

    ~Alsa() {
        if (pcm) close(pcm);
        if (library) dlclose(library);
    }
};

Result<std::unique_ptr<SoundOut>> SoundOut::open(const SoundDevice& device) {
    auto alsa = std::make_unique<Alsa>();
    alsa->library = dlopen(device.library.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!alsa->library)
        return Error{Message("there is no sound: {} cannot be loaded", {device.library}), "",
                     "install libasound2, or go on without sound"};
    int (*open_pcm)(void**, const char*, int, int) = nullptr;
    int (*set_params)(void*, int, int, unsigned, unsigned, int, unsigned) = nullptr;
    const auto find = [&](auto& function, const char* name) {
        function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(
            dlsym(alsa->library, name));
        return function != nullptr;
    };
    if (!find(open_pcm, "snd_pcm_open") || !find(set_params, "snd_pcm_set_params") ||
        !find(alsa->close, "snd_pcm_close") || !find(alsa->writei, "snd_pcm_writei") ||
        !find(alsa->recover, "snd_pcm_recover"))
        return Error{Message("there is no sound: {} lacks a function", {device.library}), "",
                     "install libasound2, or go on without sound"};
    int (*set_handler)(void (*)(const char*, int, const char*, int, const char*, ...)) = nullptr;
    if (find(set_handler, "snd_lib_error_set_handler")) set_handler(say_nothing);
    const bool opened = open_pcm(&alsa->pcm, device.name.c_str(), kPlayback, 0) == 0;
    if (!opened) alsa->pcm = nullptr;
    if (!opened || set_params(alsa->pcm, kSigned16, kInterleaved, 2, kRate, 1, kDeviceDelayUs) != 0)
        return Error{
            Message("there is no sound: the device \"{}\" cannot be opened", {device.name}), "",
            "choose a default device, or go on without sound"};
    return std::unique_ptr<SoundOut>(new SoundOut(std::move(alsa)));
}

SoundOut::SoundOut(std::unique_ptr<Alsa> alsa) : alsa_(std::move(alsa)) {
    ring_.resize(2 * static_cast<std::size_t>(kMaxWaiting * kRate) + 2 * kBlock);
    thread_ = std::thread([this] { run(); });
}

SoundOut::~SoundOut() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    more_.notify_one();
    thread_.join();
}

void SoundOut::play(std::span<const float> pairs, double hz) {
    add(pairs, hz, 1);
}

void SoundOut::play_evened(std::span<const float> pairs, double hz) {
    if (pairs.empty()) return;
    // Halves in two seconds where it has become quiet.
    loudest_ *=
        static_cast<float>(std::exp2(-0.5 * 0.5 * double(pairs.size()) / std::max(hz, 1.0)));
    for (const float v : pairs) loudest_ = std::max(loudest_, std::abs(v));
    add(pairs, hz, 0.5f / std::max(loudest_, 1e-6f));
}

void SoundOut::add(std::span<const float> pairs, double hz, float gain) {
    const std::size_t count = pairs.size() / 2;
    if (count == 0 || !(hz > 0)) return;
    {
        const std::lock_guard lock(mutex_);
        const double step = hz / kRate;
        const std::size_t room = ring_.size() / 2;
        double at = std::min(at_, double(count));
        for (; at < double(count); at += step) {
            if (count_ >= room) break;
            // Between two samples of the source; at its end the last one is held.
            const auto i = static_cast<std::size_t>(at);
            const std::size_t next = std::min(i + 1, count - 1);
            const auto part = static_cast<float>(at - double(i));
            const std::size_t to = 2 * ((first_ + count_) % room);
            for (std::size_t c = 0; c < 2; ++c)
                ring_[to + c] =
                    gain * (pairs[2 * i + c] + part * (pairs[2 * next + c] - pairs[2 * i + c]));
            ++count_;
        }
        at_ = std::max(at - double(count), 0.0);
        if (at_ >= step) at_ = 0;  // some was dropped
    }
    more_.notify_one();
}

void SoundOut::run() {
    std::array<std::int16_t, 2 * kBlock> block{};
    for (;;) {
        std::size_t taken = 0;
        {
            std::unique_lock lock(mutex_);
            more_.wait(lock, [this] { return stop_ || count_ > 0; });
            if (stop_) return;
            const std::size_t room = ring_.size() / 2;
            taken = std::min(count_, kBlock);
            for (std::size_t i = 0; i < taken; ++i) {
                const std::size_t from = 2 * ((first_ + i) % room);
                for (std::size_t c = 0; c < 2; ++c)
                    block[2 * i + c] = static_cast<std::int16_t>(
                        std::lround(32000 * std::clamp(ring_[from + c], -1.0f, 1.0f)));
            }
            first_ = (first_ + taken) % room;
            count_ -= taken;
        }
        // Waits until the device has room. A device that ran dry, or was pulled out, is started
        // again once; what it does not take is lost.
        const long written = alsa_->writei(alsa_->pcm, block.data(), taken);
        if (written < 0 && alsa_->recover(alsa_->pcm, static_cast<int>(written), 1) == 0)
            alsa_->writei(alsa_->pcm, block.data(), taken);
    }
}

}  // namespace sonocase::runtime::inline player_app
