// SPDX-License-Identifier: Apache-2.0

// Text in the HTML and SVG that this program writes.
#pragma once

#include <functional>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <utility>

namespace sonocase::pipeline::inline pictures {

// The text with the five special characters of markup escaped; suitable for attributes as well.
std::string escaped_html(std::string_view text);

// Pages from an .html file that is embedded in the program (sonocase_page in CMakeLists.txt): named
// blocks with placeholders.
//
//     <!--begin:row--><tr><td>{{name}}</td></tr><!--end:row-->
//
// {{_Words}} are words in the language of the reader. Blocks do not nest; what stands between them
// is ignored. Values are inserted as they are: escape text with escaped_html. The template belongs
// to the program, so that a block or a value that is missing is a mistake of the caller (assert).

using HtmlValues = std::initializer_list<std::pair<std::string_view, std::string_view>>;

class HtmlTemplate {
  public:
    // html: must outlive the template. words: what {{_Words}} are in another language.
    explicit HtmlTemplate(std::string_view html,
                          std::function<std::string(std::string_view)> words = {});

    // The block with every {{key}} replaced by its value.
    std::string filled(std::string_view block, HtmlValues values) const;

  private:
    std::map<std::string_view, std::string_view> blocks_;
    std::function<std::string(std::string_view)> words_;
};

}  // namespace sonocase::pipeline::inline pictures
