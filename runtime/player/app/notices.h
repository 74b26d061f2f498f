// SPDX-License-Identifier: Apache-2.0

// What the player has to report: sentences that stand at the top of the window for some seconds,
// and can be read again later.
// Warnings and errors also go to standard error, for users who started the player from a terminal.
#pragma once

#include <vector>

#include "formats/base/message.h"

namespace sonocase::runtime::inline player_app {

struct Notice {
    enum class Kind { news, warning, error } kind = Kind::news;
    Message text;
    double since_s = 0;
};

class Notices {
  public:
    // Once per picture, before anything is reported: its time. Drops notices that have stood long
    // enough.
    void set_now_s(double now_s);

    // A whole sentence. One that stands already is not repeated, but stands for its full time
    // again.
    void news(const Message& sentence) { add(Notice::Kind::news, sentence); }
    void warning(const Message& sentence) { add(Notice::Kind::warning, sentence); }
    void error(const Message& sentence) { add(Notice::Kind::error, sentence); }

    // At most four, oldest first.
    const std::vector<Notice>& standing() const { return standing_; }
    // The last forty, oldest first, whether they stand or not.
    const std::vector<Notice>& kept() const { return kept_; }
    void dismiss(std::size_t i);

  private:
    void add(Notice::Kind kind, const Message& sentence);

    double now_s_ = 0;
    std::vector<Notice> standing_, kept_;
};

}  // namespace sonocase::runtime::inline player_app
