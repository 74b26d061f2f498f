// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/look_page.h"

#include <cmath>

#include "formats/base/base64.h"
#include "formats/base/constants.h"
#include "formats/machine/machine.h"
#include "formats/text/json_reader.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/pictures/png.h"

namespace sonocase::pipeline::inline look {

extern const std::string_view kLookPageHtml;  // look_page.html, embedded by CMake

namespace {

const HtmlTemplate& page_template() {
    static const HtmlTemplate html(kLookPageHtml);
    return html;
}

std::string number(double value) {
    return std::isfinite(value) ? number_text(value, 3) : "–";
}

std::string figure(const LookPicture& picture) {
    const auto png = png_from_grey(picture.grey.data(), picture.width_px, picture.height_px);
    return page_template().filled(
        "figure", {{"caption", escaped_html(picture.caption)}, {"png", base64(png)}});
}

const char* verdict(const LookScore& score, double value) {
    if (!score.limited || !std::isfinite(value)) return "";
    return score.limits.holds(value) ? "good" : "bad";
}

std::string limits_text(const LookScore& score) {
    if (!score.limited) return "–";
    std::string text = number(score.limits.low) + " to " + number(score.limits.high);
    if (!score.limits.unit.empty()) text += " " + std::string(score.limits.unit);
    return text;
}

std::string map_text(const LooksChoice& choice) {
    return choice.map == GreyMap::log ? "logarithm over " + number(choice.dynamic_range_db) + " dB"
                                      : "power " + number(choice.exponent);
}

std::string scan_text(const LookResult& r) {
    const ScanPlace& p = r.place;
    std::string text = std::to_string(r.real.frames) + " of " + std::to_string(r.frames_given) +
                       " frames; " + (p.fan() ? "fan of " : "linear scan of ");
    text += p.fan() ? number(p.half_angle_rad * 360 / kPi) + " degrees, face radius " +
                          number(p.radius_mm) + " mm"
                    : number(p.width_mm) + " mm";
    return text + ", " + number(p.depth_mm) + " mm deep, " + number(p.mm_per_px) +
           " mm per pixel, " + (r.place_found ? "found in the pixels" : "as given") + "; " +
           std::to_string(r.real.patches) + " patches of even parenchyma.";
}

}  // namespace

std::string look_page(const LookResult& r) {
    const HtmlTemplate& html = page_template();
    std::string warnings, scores, looks, kept;
    for (const std::string& warning : r.report.warnings)
        warnings += html.filled("warning", {{"text", escaped_html(warning)}});
    for (const LookScore& s : r.scores) {
        scores += html.filled("score", {{"name", s.limits.name},
                                        {"title", escaped_html(s.limits.title)},
                                        {"real", number(s.real)},
                                        {"own", number(s.stand_in)},
                                        {"class", verdict(s, s.real)},
                                        {"own_class", verdict(s, s.stand_in)},
                                        {"limits", limits_text(s)}});
    }
    for (const LooksChoice& c : r.fit.choices) {
        looks += html.filled("look", {{"count", std::to_string(c.looks)},
                                      {"map", map_text(c)},
                                      {"misfit", number(c.misfit)}});
    }
    for (const std::string& text : r.fit.kept)
        kept += html.filled("kept", {{"text", escaped_html(text)}});
    return html.filled("page", {{"name", escaped_html(r.fit.machine.name)},
                                {"title", escaped_html(r.fit.machine.title)},
                                {"sub", escaped_html(scan_text(r))},
                                {"warnings", warnings},
                                {"figures", figure(r.frame) + figure(r.drawn)},
                                {"scores", scores},
                                {"looks", looks},
                                {"kept", kept},
                                {"toml", escaped_html(machine_toml(r.fit.machine))}});
}

std::string look_json(const LookResult& r) {
    using detail::Json;
    using detail::json_number;
    Json json;
    json["machine"] = r.fit.machine.name;
    Json& scan = json["scan"];
    scan["kind"] = r.place.fan() ? "fan" : "linear";
    scan["found"] = r.place_found;
    scan["mm_per_px"] = r.place.mm_per_px;
    scan["apex_px"] = {r.place.apex_x_px, r.place.apex_y_px};
    scan["radius_mm"] = r.place.radius_mm;
    scan["half_angle_deg"] = r.place.half_angle_rad * kDegPerRad;
    scan["width_mm"] = r.place.width_mm;
    scan["depth_mm"] = r.place.depth_mm;
    json["frames"] = {{"given", r.frames_given}, {"measured", r.real.frames}};
    json["patches"] = r.real.patches;
    json["looks"] = Json::array();
    for (const LooksChoice& c : r.fit.choices) {
        json["looks"].push_back({{"count", c.looks},
                                 {"map", c.map == GreyMap::log ? "log" : "power"},
                                 {"exponent", c.exponent},
                                 {"dynamic_range_db", c.dynamic_range_db},
                                 {"misfit", json_number(c.misfit)}});
    }
    json["scores"] = Json::array();
    for (const LookScore& s : r.scores) {
        Json one{{"name", std::string(s.limits.name)},
                 {"real", json_number(s.real)},
                 {"stand_in", json_number(s.stand_in)},
                 {"low", s.limited ? json_number(s.limits.low) : Json()},
                 {"high", s.limited ? json_number(s.limits.high) : Json()}};
        one["inside"] = s.limited && std::isfinite(s.real) ? Json(s.limits.holds(s.real)) : Json();
        json["scores"].push_back(std::move(one));
    }
    json["kept"] = r.fit.kept;
    json["warnings"] = r.report.warnings;
    return detail::json_text(json, true) + "\n";
}

}  // namespace sonocase::pipeline::inline look
