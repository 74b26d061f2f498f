// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/inspect_case.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <set>
#include <span>

#include <nlohmann/json.hpp>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/files/atomic_file.h"
#include "formats/flow/flow_summary.h"
#include "formats/volume/boundary_record.h"
#include "formats/volume/tissue.h"
#include "pipeline/export/author_key.h"

namespace sonocase::pipeline::inline exporting {

namespace {

using Json = nlohmann::ordered_json;

const char* kind_name(TissueKind kind) {
    static constexpr std::array<const char*, 5> kNames{"outside", "soft", "fluid", "gas", "bone"};
    return kNames[static_cast<std::size_t>(kind)];
}

std::string line(const char* format, auto... values) {
    char text[256];
    std::snprintf(text, sizeof text, format, values...);
    return std::string(text) + "\n";
}

Json stage_json(const StageReport& stage, double seconds) {
    Json json;
    json["name"] = stage.stage;
    json["version"] = stage.version;
    if (seconds >= 0)
        json["seconds"] = seconds;
    else
        json["seconds"] = nullptr;
    json["errors"] = Json::object();
    for (const Measure& measure : stage.measures) json["errors"][measure.name] = measure.value;
    for (const Note& note : stage.notes) json["notes"][note.name] = note.text;
    for (const MeasureGroup& group : stage.groups)
        for (const Measure& value : group.values) json[group.name][value.name] = value.value;
    json["warnings"] = stage.warnings;
    return json;
}

Json budget_json(const ErrorBudget& budget, const NextStep& next) {
    Json json;
    json["entries"] = Json::array();
    for (const BudgetEntry& e : budget.entries) {
        Json entry{{"stage", e.stage}, {"cause", e.cause}, {"mm", nullptr}, {"basis", e.basis}};
        if (std::isfinite(e.mm)) entry["mm"] = e.mm;
        json["entries"].push_back(entry);
    }
    json["known_mm"] = budget.known_mm;
    json["next"] = nullptr;
    if (!next.step.empty())
        json["next"] = {{"step", next.step},
                        {"error_from_mm", next.error_from_mm},
                        {"error_to_mm", next.error_to_mm},
                        {"more_seconds", next.more_seconds}};
    return json;
}

std::string budget_text(const ErrorBudget& budget, const NextStep& next) {
    std::string text = "\nerror budget, mean displacement of surfaces\n";
    for (const BudgetEntry& e : budget.entries) {
        if (std::isfinite(e.mm))
            text += line("  %-10s %6.2f mm  %s (%s)", e.stage.c_str(), e.mm, e.cause.c_str(),
                         e.basis.c_str());
        else
            text += line("  %-10s not known  %s: %s", e.stage.c_str(), e.cause.c_str(),
                         e.basis.c_str());
    }
    text += line("  %-10s %6.2f mm", "known", budget.known_mm);
    if (next.step.empty())
        text += "  nothing measured lowers it by a hundredth\n";
    else if (next.more_seconds > 0)
        text += line("  next: %s, from %.2f to %.2f mm for %.2g s more", next.step.c_str(),
                     next.error_from_mm, next.error_to_mm, next.more_seconds);
    else
        text += line("  next: %s, from %.2f to %.2f mm", next.step.c_str(), next.error_from_mm,
                     next.error_to_mm);
    return text;
}

// How far from their places the structures with targets, and those that are known least, may lie.
std::string unknown_text(const CaseBundle& bundle) {
    const std::vector<UnknownPlace> places = unknown_places_of_case(bundle);
    if (places.empty()) return "";
    std::string text =
        "\nplace of the structures, by what the readings leave open if the patient lies as fitted: "
        "nine times in ten within\n";
    const auto targets = static_cast<std::size_t>(std::count_if(
        places.begin(), places.end(), [](const UnknownPlace& place) { return place.target; }));
    const std::size_t shown = std::min(targets + 5, places.size());
    for (std::size_t n = 0; n < shown; ++n)
        text += line("  %-32s %6.1f mm%s", places[n].label.c_str(), places[n].p90_mm,
                     places[n].target ? "  has a target" : "");
    if (places.size() > shown)
        text += line("  the other %zu within %.1f mm", places.size() - shown, places[shown].p90_mm);
    if (const std::string advice = landmark_advice(places); !advice.empty())
        text += "  " + advice + "\n";
    return text;
}

Json unknown_json(std::span<const StageReport> stages) {
    Json json = Json::array();
    for (const UnknownPlace& place : unknown_places(stages)) {
        Json entry{{"label", place.label}, {"p90_mm", place.p90_mm}};
        if (place.with_landmarks_mm > 0) entry["with_two_landmarks_mm"] = place.with_landmarks_mm;
        json.push_back(std::move(entry));
    }
    return json;
}

// The mechanics of a label, not of its tissue, which veins and arteries may share.
TissueMechanics label_mechanics(const CaseBundle& bundle, std::size_t label) {
    for (const Tissue& tissue : bundle.tissues)
        if (tissue.name == bundle.labels[label].tissue)
            return mechanics_of(tissue, bundle.labels[label].name);
    return {};
}

Json mechanics_json(const TissueMechanics& m) {
    return {{"stiffness_kpa", m.stiffness_kpa},
            {"drains", m.drains},
            {"puncture_n", m.puncture_n},
            {"rigid", m.rigid}};
}

std::string mechanics_text(const TissueMechanics& m) {
    std::array<char, 64> text{};
    if (m.rigid) return "   rigid";
    std::snprintf(text.data(), text.size(), "%8.4g%8.4g%s", m.stiffness_kpa, m.puncture_n,
                  m.drains ? "  drains" : "");
    return text.data();
}

Json tissue_json(const Tissue& tissue) {
    return {{"name", tissue.name},
            {"kind", kind_name(tissue.kind)},
            {"casts_shadow", tissue.casts_shadow},
            {"texture", tissue.texture},
            {"grey_mean", tissue.grey_mean},
            {"grey_sd", tissue.grey_sd},
            {"echo_db", tissue.echo_db},
            {"structure_db", tissue.structure_db},
            {"attenuation_db_cm_mhz", tissue.attenuation_db_cm_mhz},
            {"impedance_mrayl", tissue.impedance_mrayl},
            {"sound_speed_m_s", tissue.sound_speed_m_s},
            {"source", tissue.source}};
}

Json region_json(const FineRegion& region) {
    const Box3& b = region.box;
    return {{"name", region.name},
            {"voxel_mm", region.grid.spacing_mm.x},
            {"size", {region.grid.size.x, region.grid.size.y, region.grid.size.z}},
            {"lower_mm", {b.lower.x, b.lower.y, b.lower.z}},
            {"upper_mm", {b.upper.x, b.upper.y, b.upper.z}},
            {"shown_by", {"physical"}}};
}

std::string region_text(const FineRegion& region) {
    const Vector3 e = region.box.extent();
    const Point3 c = region.box.centre();
    return line(
               "  region     %s: %.0f x %.0f x %.0f mm round (%.1f, %.1f, %.1f) in voxels of %g mm",
               region.name.c_str(), e.x, e.y, e.z, c.x, c.y, c.z, region.grid.spacing_mm.x) +
           "             (models other than physical show the case's own voxels there)\n";
}

constexpr double kBeatS = 60.0 / 70;

Json vessel_json(const VesselSummary& v) {
    Json json{{"name", v.name}, {"kind", name_of(v.kind)}, {"flow_ml_min", v.mean_ml_min}};
    if (v.course) {
        json["length_mm"] = v.length_mm;
        json["diameter_mm"] = v.diameter_mm;
        json["mean_cm_s"] = v.mean_cm_s;
        json["peak_cm_s"] = v.peak_cm_s;
        json["resistive_index"] = v.resistive_index;
    }
    return json;
}

std::string vessels_text(const FlowField& flow) {
    if (flow.empty()) return "";
    std::string text = line(
        "\nvessels, at 70 beats a minute          length    wide   mL/min    mean   peak cm/s   "
        "RI");
    for (const VesselSummary& v : vessel_summaries(flow, kBeatS)) {
        if (v.course)
            text += line("  %-36s %5.0f %7.1f %8.0f %7.1f %9.1f %6.2f", v.name.c_str(), v.length_mm,
                         v.diameter_mm, v.mean_ml_min, v.mean_cm_s, v.peak_cm_s, v.resistive_index);
        else
            text += line("  %-50s %8.0f", v.name.c_str(), v.mean_ml_min);
    }
    return text;
}

}  // namespace

LabelVolumes label_volumes(const CaseBundle& bundle) {
    const BrickVolume<std::uint8_t>& bricks = bundle.label_bricks;
    std::vector<std::uint64_t> voxels(256, 0);
    const Int3 count = brick_count(bricks.size);
    std::size_t brick = 0;
    for (int bk = 0; bk < count.z; ++bk) {
        for (int bj = 0; bj < count.y; ++bj) {
            for (int bi = 0; bi < count.x; ++bi, ++brick) {
                const int ni = std::min(kBrickEdge, bricks.size.x - bi * kBrickEdge),
                          nj = std::min(kBrickEdge, bricks.size.y - bj * kBrickEdge),
                          nk = std::min(kBrickEdge, bricks.size.z - bk * kBrickEdge);
                const std::uint32_t entry = bricks.table[brick];
                if (entry & kUniformBrick) {
                    voxels[bricks.uniform[entry & ~kUniformBrick]] +=
                        static_cast<std::uint64_t>(ni) * static_cast<std::uint64_t>(nj) *
                        static_cast<std::uint64_t>(nk);
                    continue;
                }
                const std::uint8_t* pool = bricks.pool.data() + std::size_t{entry} * kBrickVoxels;
                for (int k = 0; k < nk; ++k)
                    for (int j = 0; j < nj; ++j)
                        for (int i = 0; i < ni; ++i) ++voxels[pool[i + 4 * j + 16 * k]];
            }
        }
    }
    LabelVolumes volumes;
    const double voxel_ml = bundle.grid.voxel_volume_mm3() / 1000;
    for (std::size_t label = 0; label < bundle.labels.size(); ++label)
        volumes.ml.push_back(static_cast<double>(voxels[label]) * voxel_ml);
    return volumes;
}

std::vector<double> recorded_seconds(const CaseBundle& bundle,
                                     const std::string& bundle_path,
                                     const std::string& bundle_digest) {
    const std::vector<StageReport>& stages = bundle.manifest.stages;
    std::vector<double> seconds;
    for (const StageReport& stage : stages)
        seconds.push_back(stage.seconds > 0 ? stage.seconds : -1);
    const auto text = read_text_file(bundle_path + ".report.json");
    if (!text) return seconds;
    const Json json = Json::parse(*text, nullptr, false);
    if (!json.is_object() || json.value("digest", "") != bundle_digest ||
        !json.contains("stages") || !json["stages"].is_array() ||
        json["stages"].size() != stages.size())
        return seconds;
    for (std::size_t i = 0; i < stages.size(); ++i) {
        const Json& stage = json["stages"][i];
        if (stage.is_object() && stage.contains("seconds") && stage["seconds"].is_number())
            seconds[i] = stage["seconds"].get<double>();
    }
    return seconds;
}

std::string inspection_json(const CaseBundle& bundle, const Inspection& inspection) {
    const LabelVolumes volumes = label_volumes(bundle);
    Json json;
    json["case"] = bundle.manifest.case_name;
    json["producer"] = bundle.manifest.producer;
    json["bytes"] = inspection.bytes;
    json["digest"] = inspection.digest;
    const Grid& grid = bundle.grid;
    json["grid"] = {{"size", {grid.size.x, grid.size.y, grid.size.z}},
                    {"voxel_mm", grid.spacing_mm.x},
                    {"origin_mm", {grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z}}};
    if (bundle.region) json["region"] = region_json(*bundle.region);
    json["labels"] = Json::array();
    for (std::size_t i = 0; i < bundle.labels.size(); ++i)
        json["labels"].push_back({{"index", i},
                                  {"name", bundle.labels[i].name},
                                  {"tissue", bundle.labels[i].tissue},
                                  {"mechanics", mechanics_json(label_mechanics(bundle, i))},
                                  {"volume_ml", volumes.ml[i]}});
    json["vessels"] = Json::array();
    for (const VesselSummary& v : vessel_summaries(bundle.flow, kBeatS))
        json["vessels"].push_back(vessel_json(v));
    json["tissues"] = Json::array();
    for (const Tissue& tissue : bundle.tissues) json["tissues"].push_back(tissue_json(tissue));
    json["stages"] = Json::array();
    for (std::size_t i = 0; i < bundle.manifest.stages.size(); ++i)
        json["stages"].push_back(stage_json(bundle.manifest.stages[i], inspection.seconds[i]));
    json["error_budget"] = budget_json(error_budget(bundle.manifest.stages), inspection.next);
    json["unknown"] = unknown_json(bundle.manifest.stages);
    json["exercises"] = Json::array();
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        Json exercise{{"name", embedded.name}};
        if (const auto parsed = parse_exercise(embedded.toml, embedded.name)) {
            exercise["title"] = parsed->title;
            exercise["difficulty"] = parsed->difficulty;
            exercise["sweeps"] = Json::array();
            for (const Sweep& sweep : parsed->sweeps) exercise["sweeps"].push_back(sweep.name);
        }
        json["exercises"].push_back(exercise);
    }
    json["inputs"] = Json::array();
    for (const InputHash& input : bundle.manifest.inputs)
        json["inputs"].push_back({{"path", input.path}, {"digest", input.digest}});
    json["surfaces"] = {{"patient_skin_points", bundle.patient_skin.points.size()},
                        {"mannequin_points", bundle.mannequin_skin.points.size()}};
    json["textures"] = Json::array();
    for (const SolidTexture& texture : bundle.textures)
        json["textures"].push_back(
            {{"name", texture.name}, {"edge", texture.edge}, {"voxel_mm", texture.voxel_mm}});
    if (const std::string from = attribution_of(bundle); !from.empty()) json["attribution"] = from;
    json["has"] = {{"boundary", !bundle.boundary.table.empty()},
                   {"echo_offset", !bundle.echo_offset.table.empty()},
                   {"speckle_edge", bundle.speckle.edge}};
    const CaseSignature& by = inspection.signature;
    json["signature"] = nullptr;
    if (by.fit != SignatureFit::none)
        json["signature"] = {{"fit", by.fit == SignatureFit::fits      ? "fits"
                                     : by.fit == SignatureFit::differs ? "differs"
                                                                       : "unreadable"},
                             {"name", by.name},
                             {"fingerprint", fingerprint_of(by.key)}};
    return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string inspection_text(const CaseBundle& bundle, const Inspection& inspection) {
    const LabelVolumes volumes = label_volumes(bundle);
    const Grid& grid = bundle.grid;
    std::string text;
    text += line("%s", bundle.manifest.case_name.c_str());
    text += line("  file       %.1f MB, digest %s", static_cast<double>(inspection.bytes) / 1e6,
                 inspection.digest.c_str());
    text += line("  made by    %s", bundle.manifest.producer.c_str());
    if (const std::string from = attribution_of(bundle); !from.empty())
        text += "  from       " + from + "\n";
    if (const std::string by = signature_words(inspection.signature); !by.empty())
        text += "  signature  " + by + "\n";
    text += line("  grid       %d x %d x %d voxels of %g mm, origin (%.1f, %.1f, %.1f) mm",
                 grid.size.x, grid.size.y, grid.size.z, grid.spacing_mm.x, grid.origin_mm.x,
                 grid.origin_mm.y, grid.origin_mm.z);
    if (bundle.region) text += region_text(*bundle.region);
    text += line("  surfaces   patient %zu points, mannequin %zu points",
                 bundle.patient_skin.points.size(), bundle.mannequin_skin.points.size());
    text +=
        line("\nlabels (%zu)%28s%27s%8s%8s", bundle.labels.size() - 1, "tissue", "ml", "kPa", "N");
    for (std::size_t i = 1; i < bundle.labels.size(); ++i)
        text += line("  %3zu  %-32s %-22s %10.2f%s", i, bundle.labels[i].name.c_str(),
                     bundle.labels[i].tissue.c_str(), volumes.ml[i],
                     mechanics_text(label_mechanics(bundle, i)).c_str());
    text += vessels_text(bundle.flow);
    text += line("\ntissues (%zu)              echo dB  dB/cm/MHz  MRayl  kind     texture",
                 bundle.tissues.size() - 1);
    for (std::size_t i = 1; i < bundle.tissues.size(); ++i) {
        const Tissue& t = bundle.tissues[i];
        text += line("  %-24s %7.1f %10.2f %6.2f  %-8s %s%s", t.name.c_str(), t.echo_db,
                     t.attenuation_db_cm_mhz, t.impedance_mrayl, kind_name(t.kind),
                     t.texture.c_str(), t.casts_shadow ? "  (shadow)" : "");
    }
    text += "\nstages\n";
    double sum = 0;
    bool all_known = true;
    for (std::size_t i = 0; i < bundle.manifest.stages.size(); ++i) {
        const StageReport& stage = bundle.manifest.stages[i];
        const double seconds = inspection.seconds[i];
        if (seconds >= 0)
            text += line("  %-10s %8.2f s", stage.stage.c_str(), seconds);
        else
            text += line("  %-10s        - s", stage.stage.c_str());
        sum += std::max(0.0, seconds);
        all_known = all_known && seconds >= 0;
        for (const Measure& measure : stage.measures)
            text += line("      %-28s %.6g", measure.name.c_str(), measure.value);
        for (const Note& note : stage.notes)
            if (note.name != "attribution") text += "      " + note.name + ": " + note.text + "\n";
        for (const MeasureGroup& group : stage.groups) {
            text += line("      %s", group.name.c_str());
            for (const Measure& value : group.values)
                text += line("        %-26s %.3f", value.name.c_str(), value.value);
        }
        for (const std::string& warning : stage.warnings)
            text += "      warning: " + warning + "\n";
    }
    if (all_known)
        text += line("  %-10s %8.2f s", "all", sum);
    else
        text += "  (seconds stand in BUNDLE.report.json, which is not beside this bundle)\n";
    text += budget_text(error_budget(bundle.manifest.stages), inspection.next);
    text += unknown_text(bundle);
    text += "\nexercises\n";
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        text += "  " + embedded.name;
        if (exercise) {
            text += ": " + exercise->title + "; sweeps";
            for (const Sweep& sweep : exercise->sweeps) text += " " + sweep.name;
        }
        text += "\n";
    }
    if (!bundle.manifest.inputs.empty()) text += "\ninputs\n";
    for (const InputHash& input : bundle.manifest.inputs)
        text += line("  %s  %s", input.digest.c_str(), input.path.c_str());
    return text;
}

namespace {

class Findings {
  public:
    void error(std::string text) { list_.push_back({true, std::move(text)}); }
    void remark(std::string text) { list_.push_back({false, std::move(text)}); }
    std::vector<Finding> list_;
};

void check_palette(const CaseBundle& bundle, Findings& findings) {
    std::set<std::string> names, tissue_names;
    for (const Tissue& tissue : bundle.tissues)
        if (!tissue_names.insert(tissue.name).second)
            findings.error("two tissues are named '" + tissue.name + "'");
    for (const Label& label : bundle.labels) {
        if (!names.insert(label.name).second)
            findings.error("two labels are named '" + label.name + "'");
        if (tissue_names.count(label.tissue) == 0)
            findings.error("label '" + label.name + "' is of the missing tissue '" + label.tissue +
                           "'");
    }
    const LabelVolumes volumes = label_volumes(bundle);
    double body = 0;
    for (std::size_t i = 1; i < volumes.ml.size(); ++i) {
        body += volumes.ml[i];
        if (volumes.ml[i] == 0)
            findings.remark("label '" + bundle.labels[i].name +
                            "' has no voxel: it was lost on the way");
    }
    if (body == 0) findings.error("the case holds no body");
    for (const Tissue* tissue : tissues_without_texture(bundle))
        findings.error("tissue '" + tissue->name + "' asks for the missing texture '" +
                       tissue->texture + "'");
    if (bundle.speckle.edge == 0)
        findings.remark("no speckle volume: the physical model needs one");
}

// Records must name labels of the palette other than the voxel's own. Every record of a stored
// brick is checked; a wrong one shows as a speck in the image.
void check_boundary(const CaseBundle& bundle, Findings& findings) {
    if (bundle.boundary.table.empty()) {
        findings.remark("no boundary records: interfaces are drawn from whole voxels");
        return;
    }
    const Int3 size = bundle.grid.size;
    std::uint64_t strange = 0, same = 0;
    for (int k = 0; k < size.z; ++k)
        for (int j = 0; j < size.y; ++j)
            for (int i = 0; i < size.x; ++i) {
                const std::uint32_t packed = bundle.boundary.at(i, j, k);
                if (packed == kNoBoundary) continue;
                const int second = unpack_boundary(packed).second_label;
                if (second >= static_cast<int>(bundle.labels.size()))
                    ++strange;
                else if (second == bundle.label_bricks.at(i, j, k))
                    ++same;
            }
    if (strange > 0)
        findings.error(std::to_string(strange) +
                       " boundary records name labels beyond the palette");
    if (same > 0)
        findings.error(std::to_string(same) + " boundary records name their voxel's own label");
}

void check_surface(const Surface& surface, const Grid& grid, const char* what, Findings& findings) {
    if (surface.points.empty()) {
        findings.remark(std::string("no ") + what + " surface");
        return;
    }
    Box3 box = grid.bounds();
    const Vector3 far{200, 200, 200};  // a mannequin may be longer than the scan
    box.include(box.lower - far);
    box.include(box.upper + far);
    std::size_t away = 0;
    for (const Point3 p : surface.points) away += box.contains(p) ? 0 : 1;
    if (away > 0)
        findings.error(std::string(what) + " surface has " + std::to_string(away) +
                       " points far from the volume: frames are mixed up");
    for (const auto& triangle : surface.triangles)
        for (const std::uint32_t corner : triangle)
            if (corner >= surface.points.size()) {
                findings.error(std::string(what) + " surface has a triangle without its points");
                return;
            }
}

void check_exercises(const CaseBundle& bundle, Findings& findings) {
    std::set<std::string> names;
    if (bundle.exercises.empty()) findings.remark("no exercise");
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        if (!names.insert(embedded.name).second)
            findings.error("two exercises are named '" + embedded.name + "'");
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        if (!exercise) {
            findings.error(exercise.error().message().text());
            continue;
        }
        for (const Target& target : exercise->targets) {
            const Point3 v = bundle.grid.voxel_from_point(target.centre);
            const auto index = [](double x) { return static_cast<int>(std::lround(x)); };
            const bool near = std::abs(v.x) < 1e6 && std::abs(v.y) < 1e6 && std::abs(v.z) < 1e6;
            const bool inside = near && bundle.grid.contains(index(v.x), index(v.y), index(v.z)) &&
                                bundle.label_bricks.at(index(v.x), index(v.y), index(v.z)) != 0;
            if (!inside)
                findings.error(embedded.name + ": target '" + target.name +
                               "' lies outside the body");
        }
    }
}

}  // namespace

std::vector<const Tissue*> tissues_without_texture(const CaseBundle& bundle) {
    std::vector<const Tissue*> found;
    for (const Tissue& tissue : bundle.tissues) {
        const auto its_own = [&](const SolidTexture& t) { return t.name == tissue.texture; };
        if (!tissue.texture.empty() &&
            std::none_of(bundle.textures.begin(), bundle.textures.end(), its_own))
            found.push_back(&tissue);
    }
    return found;
}

std::vector<Finding> validate_case(const CaseBundle& bundle) {
    Findings findings;
    check_palette(bundle, findings);
    check_boundary(bundle, findings);
    check_surface(bundle.patient_skin, bundle.grid, "patient", findings);
    check_surface(bundle.mannequin_skin, bundle.grid, "mannequin", findings);
    check_exercises(bundle, findings);
    if (bundle.preview_png.empty()) findings.remark("no preview picture");
    return std::move(findings.list_);
}

}  // namespace sonocase::pipeline::inline exporting
