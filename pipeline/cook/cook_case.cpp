#include "pipeline/cook/cook_case.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

#include "formats/digest.h"
#include "formats/nearest_name.h"
#include "formats/registration_file.h"
#include "formats/stage_files.h"
#include "pipeline/cook/input_files.h"
#include "pipeline/cook/pack_case.h"
#include "pipeline/cook/stage_cache.h"
#include "pipeline/import/label_map.h"
#include "pipeline/import/plausible_size.h"
#include "pipeline/import/surface_file.h"
#include "pipeline/texture/speckle.h"
#include "pipeline/texture/tissue_table.h"

namespace sonocase::pipeline {
namespace {

constexpr int kSpeckleVersion = 1;

class Clock {
  public:
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

  private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// A stage's answer as it goes from stage to stage. `digest` stands for the answer in later keys;
// empty without a cache.
template <class T>
struct Made {
    T value;
    std::string digest;
};

// Runs the stages one after the other and keeps their reports.
class Cook {
  public:
    Cook(const Recipe& recipe, const CookOptions& options, const Progress& progress)
        : recipe_(recipe), cache_(options.cache_folder, options.cache_bytes), progress_(progress) {}

    // The answer of `stage` from the cache, or made by `make` and stored. `inputs` holds whatever
    // the answer depends on. The codec's encode must not depend on seconds; its reports() gives the
    // reports in the answer, whose seconds are then filled in.
    template <class Codec, class Make>
    auto run(const std::string& stage,
             int version,
             std::vector<std::string> inputs,
             double share,
             const Make& make) -> Result<Made<typename Codec::Value>> {
        using Value = typename Codec::Value;
        const double begin = done_;
        const Progress part = [this, begin, share](double fraction, std::string_view doing) {
            tell(progress_, begin + share * fraction, doing);
        };
        part(0, stage);
        done_ += share;
        std::string key;
        bool damaged = false;
        if (cache_.enabled()) {
            Digest digest;
            digest.add(std::string_view("sonocase stage")).add(std::string_view(stage));
            digest.add(std::int64_t{version});
            for (const std::string& input : inputs) digest.add(std::string_view(input));
            key = digest.hex();
            if (auto entry = cache_.find(stage, key, &damaged)) {
                auto value = Codec::decode(entry->bytes, cache_.path_of(stage, key));
                if (value) {
                    keep(Codec::reports(*value), entry->seconds, key, true);
                    return Made<Value>{std::move(*value), entry->digest};
                }
                damaged = true;
            }
        }
        const Clock clock;
        Result<Value> value = make(part);
        if (!value) return value.error();
        const double seconds = clock.seconds();
        std::string digest;
        if (cache_.enabled()) {
            CacheEntry entry{Codec::encode(*value), "", seconds};
            digest = entry.digest = digest_of(entry.bytes);
            if (auto status = cache_.store(stage, key, entry); !status)
                note_ = "the cache could not be written (" + status.error().message() + ")";
        }
        keep(Codec::reports(*value), seconds, key, false);
        if (damaged) runs_.back().report.warnings.push_back("a damaged cache entry was made anew");
        if (!note_.empty()) runs_.back().report.warnings.push_back(std::exchange(note_, {}));
        return Made<Value>{std::move(*value), digest};
    }

    Result<std::string> digest_of_file_input(const std::string& given) {
        if (given.empty()) return std::string();
        auto digest = digest_of_input(recipe_.resolve(given));
        if (digest) inputs_.push_back({given, *digest});
        return digest;
    }

    void keep(const std::vector<StageReport>& reports,
              double seconds,
              const std::string& key,
              bool cached) {
        // A stage of several parts (align, warp) knows its parts' shares itself when it ran just
        // now; from the cache, whose entries hold no seconds, the first part carries the sum.
        double known = 0;
        for (const StageReport& report : reports) known += report.seconds;
        for (std::size_t i = 0; i < reports.size(); ++i) {
            StageRun run{reports[i], key, cached};
            if (known <= 0) run.report.seconds = i == 0 ? seconds : 0;
            runs_.push_back(std::move(run));
        }
    }

    const Recipe& recipe_;
    StageCache cache_;
    const Progress& progress_;
    double done_ = 0;
    std::string note_;
    std::vector<StageRun> runs_;
    std::vector<InputHash> inputs_;
};

std::vector<StageReport> without_seconds(std::vector<StageReport> reports) {
    for (StageReport& report : reports) report.seconds = 0;
    return reports;
}

struct LabelCodec {
    using Value = LabelFile;
    static std::vector<std::uint8_t> encode(const LabelFile& file) {
        LabelFile copy = file;
        copy.reports = without_seconds(copy.reports);
        return write_label_file(copy);
    }
    static Result<LabelFile> decode(const std::vector<std::uint8_t>& bytes,
                                    const std::string& where) {
        return sonocase::read_label_file(bytes, where);
    }
    static std::vector<StageReport> reports(const LabelFile& file) { return file.reports; }
};

struct TextureCodec {
    using Value = TextureFile;
    static std::vector<std::uint8_t> encode(const TextureFile& file) {
        TextureFile copy = file;
        copy.reports = without_seconds(copy.reports);
        return write_texture_file(copy);
    }
    static Result<TextureFile> decode(const std::vector<std::uint8_t>& bytes,
                                      const std::string& where) {
        return read_texture_file(bytes, where);
    }
    static std::vector<StageReport> reports(const TextureFile& file) { return file.reports; }
};

struct RegistrationCodec {
    using Value = Registration;
    static std::vector<std::uint8_t> encode(const Registration& registration) {
        Registration copy = registration;
        copy.reports = without_seconds(copy.reports);
        const std::string text = format_registration(copy);
        return {text.begin(), text.end()};
    }
    static Result<Registration> decode(const std::vector<std::uint8_t>& bytes,
                                       const std::string& where) {
        return parse_registration({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                                  where);
    }
    static std::vector<StageReport> reports(const Registration& registration) {
        return registration.reports;
    }
};

// The recipe's [labels] laid over the built-in choice of tissues.
Status assign_tissues(const Recipe& recipe, std::vector<Label>& labels) {
    std::vector<std::string> names, tissues;
    for (const Label& label : labels) names.push_back(label.name);
    for (const Tissue& tissue : recipe.tissues) tissues.push_back(tissue.name);
    const auto known_class = total_segmentator_labels();
    for (const LabelChoice& choice : recipe.labels) {
        const std::string where = recipe.path + ":" + std::to_string(choice.line);
        if (std::find(tissues.begin(), tissues.end(), choice.tissue) == tissues.end())
            return Error{"unknown tissue '" + choice.tissue + "'", where,
                         suggest_name(choice.tissue, tissues)};
        const auto found = std::find(names.begin(), names.end(), choice.label);
        if (found == names.end()) {
            // A recipe may serve many patients; a class that this one lacks is no typo.
            if (std::find(known_class.begin(), known_class.end(), choice.label) !=
                known_class.end())
                continue;
            return Error{"label '" + choice.label + "' is not in the label map", where,
                         suggest_name(choice.label, names)};
        }
        labels[static_cast<std::size_t>(found - names.begin())].tissue = choice.tissue;
    }
    return Done{};
}

Result<LabelFile> import_labels(const Recipe& recipe, const Progress& progress) {
    LabelFile file;
    file.frame = "ct";
    const RecipeInputs& in = recipe.inputs;
    if (in.analytic) {
        const double across = in.torso.voxel_mm;
        file.volume = sample_analytic_torso(
            analytic_torso_grid({across, across, in.torso.slice_mm}), in.torso.body);
        StageReport report;
        report.stage = "import";
        report.version = kImportVersion;
        const Vector3 extent = body_box(file.volume).extent();
        report.measures = {{"labels", static_cast<double>(file.volume.labels.size() - 1)},
                           {"body_width_mm", extent.x},
                           {"body_depth_mm", extent.y},
                           {"body_height_mm", extent.z}};
        file.reports = {report};
    } else {
        ImportOptions options;
        options.table = recipe.resolve(in.label_table);
        options.scale = in.labels_scale;
        auto imported = import_label_map(recipe.resolve(in.labels), options, progress);
        if (!imported) return imported.error();
        file.volume = std::move(imported->labels);
        file.reports = {imported->report};
    }
    return file;
}

Result<Registration> fit(const Recipe& recipe,
                         const SkinSurfaceResult&,
                         const Surface&,
                         const Progress&) {
    if (!recipe.inputs.analytic)
        return Error{"no registration of files yet", recipe.path, "cook an [analytic] recipe"};
    Registration registration = analytic_torso_truth(recipe.inputs.torso.mannequin.strength);
    StageReport report;
    report.stage = "warp";
    registration.reports = {report};
    return registration;
}

Result<Surface> mannequin_of(const Recipe& recipe, StageReport* report) {
    if (recipe.inputs.analytic)
        return analytic_torso_mannequin(recipe.inputs.torso.mannequin, recipe.inputs.torso.body);
    SurfaceFileOptions options;
    options.scale = recipe.inputs.surface_scale;
    return import_surface(recipe.resolve(recipe.inputs.surface), options, report);
}

std::string number_text(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", value);
    return text;
}

// Everything of the analytic torso that a result can depend on.
std::string analytic_text(const AnalyticInput& in) {
    std::string text = "analytic";
    for (const double value :
         {in.body.width_scale, in.body.depth_scale, in.body.belly_mm, in.voxel_mm, in.slice_mm,
          in.mannequin.noise_mm, in.mannequin.strength, static_cast<double>(in.mannequin.points),
          in.mannequin.mesh ? 1.0 : 0.0, in.mannequin.front_only ? 1.0 : 0.0,
          static_cast<double>(in.mannequin.seed)})
        text += " " + number_text(value);
    return text;
}

std::string tissues_text(const std::vector<Tissue>& tissues) {
    std::string text;
    for (const Tissue& t : tissues) {
        text += t.name + "|" + t.texture + "|" + std::to_string(static_cast<int>(t.kind)) + "|" +
                (t.casts_shadow ? "1" : "0");
        for (const double value : {t.grey_mean, t.grey_sd, t.echo_db, t.structure_db,
                                   t.attenuation_db_cm_mhz, t.impedance_mrayl, t.sound_speed_m_s})
            text += "|" + number_text(value);
        text += "\n";
    }
    return text;
}

// The tissues that the palette uses, in the table's order, outside first.
std::vector<Tissue> used_tissues(const std::vector<Tissue>& all, const std::vector<Label>& labels) {
    std::vector<Tissue> used;
    for (const Tissue& tissue : all) {
        const bool wanted = tissue.name == "outside" ||
                            std::any_of(labels.begin(), labels.end(), [&](const Label& label) {
                                return label.tissue == tissue.name;
                            });
        if (wanted) used.push_back(tissue);
    }
    return used;
}

}  // namespace

Result<CookResult> cook_case(const Recipe& recipe,
                             const CookOptions& options,
                             const Progress& progress) {
    Cook cook(recipe, options, progress);
    const StageOptions& stage = recipe.options;
    const RecipeInputs& in = recipe.inputs;

    // Inputs. Every file is looked at before the first long stage.
    std::string labels_key = analytic_text(in.torso), surface_key = labels_key, examples_key;
    if (!in.analytic) {
        auto labels = cook.digest_of_file_input(in.labels);
        if (!labels) return labels.error();
        auto table = cook.digest_of_file_input(in.label_table);
        if (!table) return table.error();
        auto surface = cook.digest_of_file_input(in.surface);
        if (!surface) return surface.error();
        labels_key = *labels + " " + *table + " " + number_text(in.labels_scale);
        surface_key = *surface + " " + number_text(in.surface_scale);
    }
    auto examples = cook.digest_of_file_input(in.examples);
    if (!examples) return examples.error();
    StageReport surface_report;
    auto mannequin = mannequin_of(recipe, &surface_report);
    if (!mannequin) return mannequin.error();

    auto imported =
        cook.run<LabelCodec>("import", kImportVersion, {labels_key}, 0.03,
                             [&](const Progress& p) { return import_labels(recipe, p); });
    if (!imported) return imported.error();
    for (const std::string& warning : surface_report.warnings)
        cook.runs_.back().report.warnings.push_back("surface: " + warning);
    LabelFile& ct = imported->value;
    if (auto status = assign_tissues(recipe, ct.volume.labels); !status) return status.error();
    Box3 mannequin_box;
    for (const Point3 p : mannequin->points) mannequin_box.include(p);
    if (const auto error = check_same_unit(body_box(ct.volume).extent(), mannequin_box.extent(),
                                           in.analytic ? "(analytic)" : recipe.resolve(in.surface)))
        return *error;

    // Surface and registration.
    const Clock surface_clock;
    auto skin = extract_skin_surface(ct.volume, stage.surface);
    if (!skin) return skin.error();
    skin->report.seconds = surface_clock.seconds();
    cook.runs_.push_back({skin->report, "", false});
    auto registered = cook.run<RegistrationCodec>(
        "warp", 1, {imported->digest, surface_key, canonical_options("surface", stage)}, 0.2,
        [&](const Progress& p) -> Result<Registration> {
            return fit(recipe, *skin, *mannequin, p);
        });
    if (!registered) return registered.error();
    const Registration& registration = registered->value;

    // Volumes.
    auto resampled = cook.run<LabelCodec>(
        "resample", kResampleVersion,
        {imported->digest, registered->digest, canonical_options("resample", stage)},
        0.4, [&](const Progress& p) -> Result<LabelFile> {
            auto result = resample_labels({ct.volume, registration}, stage.resample, p);
            if (!result) return result.error();
            return LabelFile{"mannequin",
                             std::move(result->volume),
                             std::move(result->boundary),
                             {},
                             {result->report}};
        });
    if (!resampled) return resampled.error();

    // Textures.
    std::vector<Label>& palette = resampled->value.volume.labels;
    if (auto status = assign_tissues(recipe, palette); !status) return status.error();
    const std::vector<Tissue> tissues = used_tissues(recipe.tissues, palette);
    auto textures = cook.run<TextureCodec>(
        "texture", kSpeckleVersion,
        {*examples, tissues_text(tissues), canonical_options("texture", stage),
         canonical_options("case", stage)},
        0.15, [&](const Progress& p) -> Result<TextureFile> {
            TextureBankOptions bank = stage.texture.bank;
            bank.example_folder = recipe.resolve(in.examples);
            bank.seed = static_cast<std::uint64_t>(stage.seed);
            auto result = build_texture_bank(tissues, bank, p);
            if (!result) return result.error();
            return TextureFile{std::move(result->textures),
                               make_speckle(stage.texture.speckle_edge, bank.seed),
                               tissues,
                               {result->report}};
        });
    if (!textures) return textures.error();

    // Pack.
    const Clock pack_clock;
    tell(progress, 0.95, "packing");
    auto packed = pack_case({recipe.name, recipe.text, recipe.exercises, &skin->skin, &registration,
                             *mannequin, resampled->value, textures->value, tissues});
    if (!packed) return packed.error();
    packed->report.seconds = pack_clock.seconds();
    cook.runs_.push_back({packed->report, "", false});

    CookResult result{std::move(packed->bundle), std::move(cook.runs_)};
    CaseManifest& manifest = result.bundle.manifest;
    manifest.producer = options.producer;
    manifest.inputs = std::move(cook.inputs_);
    for (const StageRun& run : result.stages) {
        manifest.stages.push_back(run.report);
        manifest.stages.back().seconds = 0;
        // What happened in the cache is this run's story, not the bundle's.
        std::erase_if(manifest.stages.back().warnings,
                      [](const std::string& w) { return w.find("cache") != std::string::npos; });
    }
    tell(progress, 1, "done");
    return result;
}

}  // namespace sonocase::pipeline
