// SPDX-License-Identifier: Apache-2.0

// Taps of keys that are over before the next picture. Dear ImGui sees only what is held when a
// picture begins, so that such a key is held down for one picture more.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace sonocase::runtime {

template <std::size_t kKeys>
class KeyTaps {
  public:
    // Whenever a key goes down; others than [0, kKeys) are left out.
    void press(int key) {
        if (key >= 0 && key < static_cast<int>(kKeys))
            pressed_[static_cast<std::size_t>(key)] = true;
    }
    // At the start of a picture. down: what is held, # kKeys at least. Holds the keys whose tap is
    // over, until release() at its end.
    void hold(std::span<bool> down) {
        for (std::size_t key = 0; key < kKeys; ++key) {
            if (pressed_[key] && !down[key]) {
                down[key] = true;
                held_.push_back(key);
            }
            pressed_[key] = false;
        }
    }
    void release(std::span<bool> down) {
        for (const std::size_t key : held_) down[key] = false;
        held_.clear();
    }

  private:
    std::array<bool, kKeys> pressed_{};  // since the last picture began
    std::vector<std::size_t> held_;
};

}  // namespace sonocase::runtime
