// SPDX-License-Identifier: Apache-2.0

// Sound: short tones that say what happened to those who do not look at the screen, and the device
// that plays them.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime::inline player_app {

enum class Tone { target, harm };

inline constexpr double kToneHz = 24000;  // samples per second

// Pairs of samples in [-0.3, 0.3], which begin and end with 0. target: two notes upwards, 0.22 s;
// harm: one low note, 0.3 s.
std::vector<float> tone(Tone what);

// Sound through the default device: ALSA's library, looked up when sound is first wanted, so that
// the program neither links nor needs it. A thread of its own hands samples to the device and
// sleeps while there are none.

struct SoundDevice {
    std::string library = "libasound.so.2", name = "default";
};

class SoundOut {
  public:
    // Errors: no library, no device; both say that the program goes on without sound.
    static Result<std::unique_ptr<SoundOut>> open(const SoundDevice& device = {});
    ~SoundOut();
    SoundOut(const SoundOut&) = delete;
    SoundOut& operator=(const SoundOut&) = delete;

    // Pairs of samples (left, right) at a rate of hz; heard after what waits already. What does not
    // fit into kMaxWaiting is dropped: sound that comes late is worse than none. From any thread;
    // never waits for the device, and does not allocate.
    static constexpr double kMaxWaiting = 0.25;  // s
    void play(std::span<const float> pairs, double hz);
    // The same, with a loudness that follows the loudest of the last seconds.
    void play_evened(std::span<const float> pairs, double hz);

  private:
    struct Alsa;
    explicit SoundOut(std::unique_ptr<Alsa> alsa);
    void add(std::span<const float> pairs, double hz, float gain);
    void run();

    std::unique_ptr<Alsa> alsa_;
    std::mutex mutex_;
    std::condition_variable more_;
    bool stop_ = false;
    std::vector<float> ring_;  // pairs at kToneHz
    std::size_t first_ = 0, count_ = 0;
    double at_ = 0;  // part of a sample of the source that the next one begins at
    float loudest_ = 1e-6f;
    std::thread thread_;
};

}  // namespace sonocase::runtime::inline player_app
