// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/markup.h"

#include <algorithm>
#include <cassert>

namespace sonocase::pipeline::inline pictures {

std::string escaped_html(std::string_view text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '<': out += "&lt;"; break;
            case '>': out += "&gt;"; break;
            case '&': out += "&amp;"; break;
            case '"': out += "&quot;"; break;
            case '\'': out += "&#39;"; break;
            default: out += c;
        }
    }
    return out;
}

HtmlTemplate::HtmlTemplate(std::string_view html,
                           std::function<std::string(std::string_view)> words)
    : words_(std::move(words)) {
    constexpr std::string_view kBegin = "<!--begin:", kTail = "-->";
    for (std::size_t at = 0; (at = html.find(kBegin, at)) != std::string_view::npos;) {
        const std::size_t name_at = at + kBegin.size(), name_end = html.find(kTail, name_at);
        assert(name_end != std::string_view::npos);
        const std::string_view name = html.substr(name_at, name_end - name_at);
        const std::size_t first = name_end + kTail.size();
        const std::size_t last = html.find("<!--end:" + std::string(name) + "-->", first);
        assert(last != std::string_view::npos);
        blocks_[name] = html.substr(first, last - first);
        at = last;
    }
}

std::string HtmlTemplate::filled(std::string_view block, HtmlValues values) const {
    const auto found = blocks_.find(block);
    assert(found != blocks_.end());
    const std::string_view text = found->second;
    std::string out;
    std::size_t at = 0;
    for (;;) {
        const std::size_t open = text.find("{{", at);
        out += text.substr(at, open - at);
        if (open == std::string_view::npos) return out;
        const std::size_t close = text.find("}}", open);
        assert(close != std::string_view::npos);
        const std::string_view key = text.substr(open + 2, close - open - 2);
        at = close + 2;
        if (key.starts_with('_')) {
            const std::string_view english = key.substr(1);
            out += escaped_html(words_ ? words_(english) : std::string(english));
            continue;
        }
        const auto value = std::find_if(values.begin(), values.end(),
                                        [&](const auto& pair) { return pair.first == key; });
        assert(value != values.end());
        out += value->second;
    }
}

}  // namespace sonocase::pipeline::inline pictures
