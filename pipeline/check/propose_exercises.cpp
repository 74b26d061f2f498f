// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/propose_exercises.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <string_view>
#include <utility>

#include "formats/exercise/exercise.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/text.h"
#include "pipeline/check/aim.h"
#include "pipeline/check/case_labels.h"
#include "pipeline/check/scripted_expert.h"

namespace sonocase::pipeline::inline check {

// Exercises of scenarios/, embedded by CMake.
extern const std::string_view kLiverBiopsyToml, kKidneyAccessToml, kAbscessDrainageToml,
    kFemoralAccessToml, kCompressionTestToml, kLiverProcedureToml, kNephrostomyToml,
    kFemoralLineToml;

namespace {

struct Template {
    const char* name;  // of the exercise that is written
    const std::string_view* toml;
    double height;  // of the target in its structure: 0 towards the feet, 1 towards the head
    std::vector<std::string> also;  // structures that the exercise needs besides the target's
    bool left = false;  // the text is of the right side and the exercise of the other one
};

const std::vector<Template>& templates() {
    static const std::vector<Template> table{
        {"liver-biopsy", &kLiverBiopsyToml, 0.5, {}},
        {"kidney-access", &kKidneyAccessToml, 0.3, {}},
        {"abscess-drainage", &kAbscessDrainageToml, 0.5, {}},
        {"femoral-access", &kFemoralAccessToml, 0.1, {"iliac_artery_right"}},
        {"compression-test", &kCompressionTestToml, 0.1, {}},
        {"liver-biopsy-whole", &kLiverProcedureToml, 0.5, {}},
        {"nephrostomy", &kNephrostomyToml, 0.3, {}},
        {"femoral-line", &kFemoralLineToml, 0.1, {"iliac_artery_right"}},
        {"kidney-access-left", &kKidneyAccessToml, 0.3, {}, true},
        {"abscess-drainage-left", &kAbscessDrainageToml, 0.5, {}, true},
        {"femoral-access-left", &kFemoralAccessToml, 0.1, {"iliac_artery_left"}, true},
        {"compression-test-left", &kCompressionTestToml, 0.1, {}, true},
        {"nephrostomy-left", &kNephrostomyToml, 0.3, {}, true},
        {"femoral-line-left", &kFemoralLineToml, 0.1, {"iliac_artery_left"}, true},
    };
    return table;
}

bool is_letter(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c & 0x80) != 0;
}

// The template's text; for the left side with the names of labels and the words of the left, and
// the spleen in the liver's place among what is to be spared.
std::string toml_of(const Template& from) {
    std::string out(*from.toml);
    if (!from.left) return out;
    constexpr std::pair<std::string_view, std::string_view> kWords[] = {{"right", "left"},
                                                                        {"rechten", "linken"},
                                                                        {"rechte", "linke"},
                                                                        {"liver", "spleen"},
                                                                        {"Leber", "Milz"}};
    for (const auto& [word, by] : kWords) {
        for (std::size_t at = 0; (at = out.find(word, at)) != out.npos; at += by.size()) {
            const std::size_t end = at + word.size();
            if ((at > 0 && is_letter(out[at - 1])) || (end < out.size() && is_letter(out[end])))
                continue;  // such as "bright"
            out.replace(at, word.size(), by);
        }
    }
    return out;
}

// Places of a label, and how far inside it they lie, mm, along the axes of the grid.
struct Inside {
    Point3 at;
    double depth_mm = 0;
};

// Every voxel of the label that no neighbour exceeds by more than a voxel's step in depth.
std::vector<Inside> places_inside(const CaseBundle& bundle, int label) {
    const Grid& grid = bundle.grid;
    Int3 low = grid.size, high{-1, -1, -1};
    for (int k = 0; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                if (bundle.label_bricks.at(i, j, k) != label) continue;
                low = {std::min(low.x, i), std::min(low.y, j), std::min(low.z, k)};
                high = {std::max(high.x, i), std::max(high.y, j), std::max(high.z, k)};
            }
    if (high.x < 0) return {};
    // Steps to the nearest voxel of another label, by two passes; a margin of one voxel about.
    const Int3 size{high.x - low.x + 3, high.y - low.y + 3, high.z - low.z + 3};
    std::vector<std::uint16_t> steps(static_cast<std::size_t>(size.x) *
                                         static_cast<std::size_t>(size.y) *
                                         static_cast<std::size_t>(size.z),
                                     0);
    const std::ptrdiff_t step[3] = {1, size.x, static_cast<std::ptrdiff_t>(size.x) * size.y};
    const auto at = [&](int i, int j, int k) { return i + step[1] * j + step[2] * k; };
    for (int k = 1; k < size.z - 1; ++k)
        for (int j = 1; j < size.y - 1; ++j)
            for (int i = 1; i < size.x - 1; ++i) {
                if (bundle.label_bricks.at(low.x + i - 1, low.y + j - 1, low.z + k - 1) != label)
                    continue;
                const std::ptrdiff_t n = at(i, j, k);
                std::uint16_t least = UINT16_MAX - 1;
                for (const std::ptrdiff_t s : step)
                    least = std::min(least, steps[static_cast<std::size_t>(n - s)]);
                steps[static_cast<std::size_t>(n)] = static_cast<std::uint16_t>(least + 1);
            }
    std::vector<Inside> places;
    for (int k = size.z - 2; k > 0; --k)
        for (int j = size.y - 2; j > 0; --j)
            for (int i = size.x - 2; i > 0; --i) {
                const std::ptrdiff_t n = at(i, j, k);
                std::uint16_t& own = steps[static_cast<std::size_t>(n)];
                if (own == 0) continue;
                for (const std::ptrdiff_t s : step)
                    own = std::min<std::uint16_t>(
                        own,
                        static_cast<std::uint16_t>(steps[static_cast<std::size_t>(n + s)] + 1));
                places.push_back(
                    {grid.point_from_voxel(
                         {double(low.x + i - 1), double(low.y + j - 1), double(low.z + k - 1)}),
                     own * grid.spacing_mm.x});
            }
    return places;
}

constexpr std::size_t kPlaces = 5;

// Up to five places at which a ball of the radius lies in the structure, first the one at the given
// height, then those farthest from all before. Empty: there is no room.
std::vector<Point3> target_places(std::vector<Inside> places, double radius_mm, double height) {
    if (places.empty()) return {};
    double low = HUGE_VAL, high = -HUGE_VAL, deepest = 0;
    for (const Inside& p : places) {
        low = std::min(low, p.at.z);
        high = std::max(high, p.at.z);
        deepest = std::max(deepest, p.depth_mm);
    }
    // Steps along the axes are up to sqrt(3) times the distance; a thin structure has what it has.
    const double need = std::min(1.3 * radius_mm, deepest);
    if (need < 0.8 * radius_mm) return {};
    std::erase_if(places, [&](const Inside& p) { return p.depth_mm < need; });
    Vector3 sum;
    for (const Inside& p : places) sum = sum + (p.at - Point3{});
    Point3 wanted = Point3{} + sum / static_cast<double>(places.size());
    wanted.z = low + height * (high - low);
    const auto height_off = [&](Point3 p) { return std::abs(p.z - wanted.z); };
    // A third of the structure's height about the wanted one, if there is anything.
    const double band = std::max(
        (high - low) / 6,
        height_off(
            std::min_element(places.begin(), places.end(), [&](const auto& a, const auto& b) {
                return height_off(a.at) < height_off(b.at);
            })->at));
    std::erase_if(places, [&](const Inside& p) { return height_off(p.at) > band; });
    std::vector<Point3> chosen;
    std::vector<double> away(places.size());
    for (std::size_t n = 0; n < places.size(); ++n) away[n] = distance(places[n].at, wanted);
    auto next = static_cast<std::size_t>(std::min_element(away.begin(), away.end()) - away.begin());
    std::fill(away.begin(), away.end(), HUGE_VAL);
    while (chosen.size() < kPlaces) {
        chosen.push_back(places[next].at);
        for (std::size_t n = 0; n < places.size(); ++n)
            away[n] = std::min(away[n], distance(places[n].at, chosen.back()));
        next = static_cast<std::size_t>(std::max_element(away.begin(), away.end()) - away.begin());
        if (away[next] < 2 * radius_mm) break;
    }
    return chosen;
}

std::string triple(Point3 p) {
    return text("[%.1f, %.1f, %.1f]", p.x, p.y, p.z);
}
std::string short_direction(Vector3 v) {
    return text("[%.4f, %.4f, %.4f]", v.x, v.y, v.z);
}

// The key of a line "key = ...", else empty.
std::string_view key_of(std::string_view line) {
    const std::size_t equals = line.find(" = ");
    return equals == line.npos ? std::string_view{} : line.substr(0, equals);
}

// "no_go = [...]" with the labels that the case has.
std::string no_go_line(const Exercise& exercise, const CaseLabels& labels) {
    std::string line;
    for (const std::string& name : exercise.no_go)
        if (labels.find(name) > 0) line += (line.empty() ? "\"" : ", \"") + name + "\"";
    return "no_go = [" + line + "]\n";
}

struct Placed {
    Point3 centre;
    AimResult aimed;
};

// The sweeps of `aim`, each behind its own heading.
std::string sweeps_of(const std::string& aimed) {
    const std::size_t at = aimed.find("\n[[sweeps]]");
    return at == aimed.npos ? "" : aimed.substr(at);
}

// The template's text with the new places and sweeps; comments and everything else as they are.
// Relies on the form of the scenarios' files: a key per line, tables after their headings.
std::string with_places(const Template& from,
                        const Exercise& exercise,
                        const CaseLabels& labels,
                        const Placed& placed) {
    const AimWindow& window = placed.aimed.windows.front();
    std::string out =
        "# Proposed for this patient by `sonocase make`, which leaves a file alone that you have "
        "changed.\n";
    std::string table, held;  // held: comments, which belong to the line that follows them
    bool dropped = false;
    const std::string toml = toml_of(from);
    std::string_view rest = toml;
    while (!rest.empty()) {
        const std::size_t end = std::min(rest.find('\n'), rest.size() - 1) + 1;
        const std::string_view line = rest.substr(0, end);
        rest.remove_prefix(end);
        if (line.starts_with('#') || line == "\n") {
            held += line;
            continue;
        }
        if (line.starts_with('[')) {
            table = std::string(line.substr(0, line.find_last_of(']') + 1));
            dropped = table.starts_with("[[sweeps");
        }
        if (!dropped) out += held;
        held.clear();
        if (dropped) continue;
        const std::string_view key = key_of(line);
        if (table.empty() && key == "name")
            out += std::string("name = \"") + from.name + "\"\n";
        else if (table.empty() && key == "start_probe")
            out += "start_probe = " + triple(window.skin) + "\n";
        else if (table.empty() && key == "start_beam")
            out += "start_beam = " + short_direction(window.beam) +
                   "\nstart_lateral = " + short_direction(window.lateral) + "\n";
        else if (table.empty() && key == "start_lateral")
            ;  // stands beside the beam
        else if (table.empty() && key == "no_go")
            out += no_go_line(exercise, labels);
        else if (table == "[[targets]]" && key == "centre")
            out += "centre = " + triple(placed.centre) + "\n";
        else
            out += line;
    }
    const Target& target = exercise.targets.front();
    return out + sweeps_of(aim_exercise(
                     {target.name, placed.centre, target.radius_mm, exercise.name, target.inside},
                     placed.aimed, aim_options(exercise)));
}

// The exercise as its file has it; its frame is what a case on the patient's own skin has anyway.
Result<Exercise> exercise_of(const Template& from) {
    std::string read = toml_of(from);
    constexpr std::string_view kFrame = "frame = \"ct\"\n";
    if (const std::size_t at = read.find(kFrame); at != read.npos) read.erase(at, kFrame.size());
    return parse_exercise(read, from.name);
}

// The first structure that the exercise needs and that is not there; empty: all are.
std::string missing(const Template& from,
                    const Exercise& exercise,
                    const std::function<bool(const std::string& name)>& has) {
    std::vector<std::string> needs = from.also;
    needs.insert(needs.begin(), exercise.targets.front().inside);
    for (const std::string& name : needs)
        if (!has(name)) return "there is no '" + name + "'";
    return "";
}

Proposal propose(const Template& from, const CaseLabels& labels) {
    const CaseBundle& bundle = labels.bundle();
    Proposal proposal{from.name, "", "", "", {}, 0};
    auto exercise = exercise_of(from);
    if (!exercise) {
        proposal.why = exercise.error().message().text();
        return proposal;
    }
    Target& target = exercise->targets.front();
    const auto has = [&](const std::string& name) { return labels.find(name) > 0; };
    std::erase_if(exercise->no_go, [&](const std::string& name) { return !has(name); });
    proposal.why = missing(from, *exercise, has);
    if (!proposal.why.empty()) return proposal;
    const std::vector<Point3> places = target_places(
        places_inside(bundle, labels.find(target.inside)), target.radius_mm, from.height);
    if (places.empty()) {
        proposal.why = text("'%s' has no room for a target of %.0f mm", target.inside.c_str(),
                            2 * target.radius_mm);
        return proposal;
    }
    AimOptions options = aim_options(*exercise);
    options.windows = 3;
    const bool scan = exercise->kind == "scan";
    std::string missed = "no window on the skin sees '" + target.inside + "'";
    for (const Point3 place : places) {
        target.centre = place;
        Placed placed{
            place,
            aim(labels, {target.name, place, target.radius_mm, exercise->name, target.inside},
                options)};
        const auto& windows = placed.aimed.windows;
        if (windows.empty()) continue;
        if (!windows.front().needle && !scan) {
            missed = "no needle reaches '" + target.inside +
                     "' past bone, gas, vessels and what "
                     "is to be spared";
            continue;
        }
        if (!scan) {
            const auto marks = play_as_expert(bundle, *exercise, {windows.front()}).missed;
            if (!marks.empty()) {
                missed = "a scripted expert misses " + marks.front();
                continue;
            }
        }
        proposal.toml = with_places(from, *exercise, labels, placed);
        proposal.why = text("target in '%s', %.0f mm deep, %zu windows%s", target.inside.c_str(),
                            windows.front().depth_mm, windows.size(),
                            scan ? "" : ", a scripted expert passes");
        proposal.target = target.name;
        proposal.centre = place;
        proposal.radius_mm = target.radius_mm;
        return proposal;
    }
    proposal.why = missed;
    return proposal;
}

}  // namespace

std::string why_none_fits(const std::vector<Label>& labels) {
    std::string why;
    for (const Template& from : templates()) {
        const auto exercise = exercise_of(from);
        const std::string lacks =
            !exercise ? exercise.error().message().text()
                      : missing(from, *exercise, [&](const std::string& name) {
                            return std::any_of(labels.begin(), labels.end(),
                                               [&](const Label& l) { return l.name == name; });
                        });
        if (lacks.empty()) return "";
        if (why.find(lacks) == why.npos) why += (why.empty() ? "" : ", ") + lacks;
    }
    return why;
}

std::vector<Proposal> propose_exercises(const CaseBundle& bundle,
                                        const std::function<void(double share)>& told) {
    const CaseLabels labels(bundle);
    const std::vector<Template>& from = templates();
    std::vector<Proposal> proposals(from.size());
    std::size_t done = 0;
    std::mutex telling;
    parallel_for(from.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            proposals[n] = propose(from[n], labels);
            const std::lock_guard lock(telling);
            if (told) told(static_cast<double>(++done) / static_cast<double>(from.size()));
        }
    });
    return proposals;
}

}  // namespace sonocase::pipeline::inline check
