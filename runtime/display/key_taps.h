// SPDX-License-Identifier: Apache-2.0

// Key presses between two pictures. Dear ImGui sees only keys that are held when a picture begins,
// and a press only where the key was up in the picture before. So each press is shown in a picture
// of its own: a key that is up again already is held for that picture, and one that is pressed anew
// is let go for a picture first. The modifiers that were held at the press go with it.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace sonocase::runtime::inline display {

template <std::size_t kKeys>
class KeyTaps {
  public:
    // Call this whenever a key goes down; keys outside [0, kKeys) are ignored. modifiers: any bits.
    void press(int key, int modifiers = 0) {
        if (key < 0 || key >= static_cast<int>(kKeys)) return;
        Key& k = keys_[static_cast<std::size_t>(key)];
        if (k.waiting < kMaxWaiting) ++k.waiting;
        k.modifiers = modifiers;
    }
    // Call this at the start of a picture. down: the keys that are held, at least kKeys of them.
    // Changes those whose presses have to be shown; release() at the end of the picture undoes
    // that. Returns the modifiers of the presses that this picture shows.
    int hold(std::span<bool> down) {
        int modifiers = 0;
        for (std::size_t key = 0; key < kKeys; ++key) {
            Key& k = keys_[key];
            bool shown = down[key];
            if (k.waiting > 0) {
                shown = !k.shown;
                k.waiting -= shown;
                if (shown) modifiers |= k.modifiers;
            }
            k.shown = shown;
            if (shown == down[key]) continue;
            down[key] = shown;
            changed_.push_back(key);
        }
        return modifiers;
    }
    void release(std::span<bool> down) {
        for (const std::size_t key : changed_) down[key] = !down[key];
        changed_.clear();
    }
    // Presses that no picture has shown yet.
    bool waiting() const {
        for (const Key& k : keys_)
            if (k.waiting > 0) return true;
        return false;
    }

  private:
    static constexpr int kMaxWaiting = 8;  // of a key: more are not caught up with
    struct Key {
        int waiting = 0, modifiers = 0;
        bool shown = false;  // in the last picture
    };
    std::array<Key, kKeys> keys_{};
    std::vector<std::size_t> changed_;
};

}  // namespace sonocase::runtime::inline display
