// SPDX-License-Identifier: Apache-2.0

// Key presses that end before the next picture begins. Dear ImGui sees only keys that are held when
// a picture begins, so such a key is held down for one more picture.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace sonocase::runtime::inline display {

template <std::size_t kKeys>
class KeyTaps {
  public:
    // Call this whenever a key goes down; keys outside [0, kKeys) are ignored.
    void press(int key) {
        if (key >= 0 && key < static_cast<int>(kKeys)) pressed_[key] = true;
    }
    // Call this at the start of a picture. down: the keys that are held, at least kKeys of them.
    // Adds the keys whose tap is over; release() at the end of the picture takes them away again.
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

}  // namespace sonocase::runtime::inline display
