// SPDX-License-Identifier: Apache-2.0

// The acts of a trainee in a procedure, beside moving probe and needle; in sessions, tracker
// readings and sweeps.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase {

// What a hand does beside moving the tools, by a key, the wheel or a pedal.
enum class ActKind : std::uint8_t {
    inject,      // amount: ml of local anaesthetic, through the needle
    aspirate,    // ml drawn back through the needle
    core_throw,  // mm that the core needle is thrown: 15 or 22
    wire,        // mm that the guide wire is advanced through the needle; negative: drawn back
    dilate,      // over the wire
    catheter,    // over the wire, or over the needle into a collection
    drain,       // ml let out of the collection in which the catheter or the needle is
    compress,    // 1: a hand presses on the puncture; 0: it lets go
    rescan,      // the trainee says: I look once more
    answer,      // index: item; amount: the option chosen, from 0
    tilt,        // the table: degrees head down; 0: level
    valsalva,    // 1: the patient strains against closed lips; 0: breathes again
    turn,        // the patient: degrees onto the left side; negative: right; 0: on the back
};
inline constexpr int kActKinds = 13;
const std::vector<std::string>& act_names();  // in the order of the enumeration

struct Act {
    ActKind kind = ActKind::inject;
    int index = 0;
    double amount = 0;
    friend bool operator==(const Act&, const Act&) = default;
};

// The acts of one frame; fixed in size, so that a frame loop hands them on without allocating. Acts
// beyond the last are left to the next frame by who collects them.
struct ActList {
    static constexpr int kMaxActs = 4;
    std::array<Act, kMaxActs> acts{};
    int count = 0;
    bool add(const Act& act);  // false: full
    friend bool operator==(const ActList&, const ActList&) = default;
};

// "inject=2.5;answer:3=1", as recordings and sweeps have it. acts_of() leaves out what it cannot
// read, or what is more than a list holds, and puts the first of it into `unread`, if given.
std::string acts_text(const ActList& acts);
ActList acts_of(std::string_view text, std::string* unread = nullptr);

}  // namespace sonocase
