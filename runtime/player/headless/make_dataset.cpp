// SPDX-License-Identifier: Apache-2.0

// The chunks of a data set, and its arrays as NumPy writes them (.npy, version 1.0), which
// numpy.load opens, also memory-mapped.

#include "runtime/player/headless/make_dataset.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "formats/base/constants.h"
#include "formats/base/result.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "runtime/player/headless/dataset_recipe.h"
#include "runtime/player/headless/frame_draw.h"
#include "runtime/player/headless/truth_files.h"
#include "runtime/player/session/open_case.h"
#include "runtime/player/session/png_file.h"

namespace sonocase::runtime::inline player_headless {

// type: NumPy's, as "|u1" or "<f4"; shape: slowest first; bytes: the values, in C order.
// The file appears under its name complete or not at all. Errors: it cannot be written.
Status write_npy(const std::string& path,
                 const std::string& type,
                 const std::vector<std::size_t>& shape,
                 std::span<const std::uint8_t> bytes);

Status write_npy(const std::string& path,
                 const std::string& type,
                 const std::vector<std::size_t>& shape,
                 std::span<const std::uint8_t> bytes) {
    std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (";
    for (const std::size_t n : shape) header += std::to_string(n) + ", ";
    header += "), }";
    // Magic, version and length take ten bytes; the values begin at a multiple of 64.
    while ((header.size() + 11) % 64 != 0) header += ' ';
    header += '\n';
    std::vector<std::uint8_t> file{0x93,
                                   'N',
                                   'U',
                                   'M',
                                   'P',
                                   'Y',
                                   1,
                                   0,
                                   static_cast<std::uint8_t>(header.size() & 0xFF),
                                   static_cast<std::uint8_t>(header.size() >> 8)};
    file.insert(file.end(), header.begin(), header.end());
    file.insert(file.end(), bytes.begin(), bytes.end());
    return write_file(path, file);
}

// One chunk of a data set: frames that share a case, an exercise, a machine, a depth and a needle.

struct DatasetPlan {
    DatasetRecipe recipe;
    std::string folder;  // of the data set
    std::uint64_t seed = 1;
    std::uint64_t frames = 0;

    std::uint64_t chunks() const {
        const auto size = static_cast<std::uint64_t>(recipe.chunk);
        return (frames + size - 1) / size;
    }
    std::uint64_t first(std::uint64_t chunk) const {
        return chunk * static_cast<std::uint64_t>(recipe.chunk);
    }
    std::uint64_t last(std::uint64_t chunk) const {  // one beyond
        const std::uint64_t end = first(chunk) + static_cast<std::uint64_t>(recipe.chunk);
        return end < frames ? end : frames;
    }
    // Cases take turns.
    std::size_t case_of(std::uint64_t chunk) const { return chunk % recipe.cases.size(); }
    std::string records_path(std::uint64_t chunk) const;
};

// A case of the recipe, opened.
struct DatasetSource {
    DatasetCase of;
    std::unique_ptr<OpenCase> open;
    std::unique_ptr<SkinAreas> areas;
};

// Renders a chunk and writes its files, its records last: where they are, the chunk is whole.
Status make_chunk(const DatasetPlan& plan, const DatasetSource& source, std::uint64_t chunk);

namespace {

using Json = nlohmann::ordered_json;

std::string numbered(std::uint64_t n, int digits) {
    char text[32];
    std::snprintf(text, sizeof text, "%0*llu", digits, static_cast<unsigned long long>(n));
    return text;
}

// What the frames of a chunk share.
struct ChunkSetUp {
    Exercise exercise;
    std::string machine;
};

Result<ChunkSetUp> set_up_of(const DatasetPlan& plan,
                             const DatasetSource& source,
                             std::uint64_t chunk) {
    const DatasetRecipe& r = plan.recipe;
    Draw draw(plan.seed, 2, chunk);
    ChunkSetUp set_up;
    const auto& names = source.of.exercises;
    if (names.empty()) {
        set_up.exercise = source.open->exercises[draw.below(source.open->exercises.size())];
    } else {
        SONOCASE_TRY(const int found, find_exercise(*source.open, names[draw.below(names.size())]));
        set_up.exercise = source.open->exercises[found];
    }
    if (!r.machines.empty()) set_up.machine = r.machines[draw.below(r.machines.size())];
    if (!r.depths_mm.empty())
        set_up.exercise.probe.depth_mm = r.depths_mm[draw.below(r.depths_mm.size())];
    set_up.exercise.needle.gauge = r.gauges[draw.below(r.gauges.size())];
    return set_up;
}

Json record_of(const DatasetPlan& plan,
               const DatasetSource& source,
               const ChunkSetUp& set_up,
               std::uint64_t chunk,
               std::uint64_t frame,
               const DrawnFrame& drawn,
               const Renderer::Layout& layout) {
    Json record = {{"index", frame}};
    if (plan.recipe.format == "png") {
        record["image"] = "frames/image_" + numbered(frame, 8) + ".png";
    } else {
        record["chunk"] = chunk;
        record["row"] = frame - plan.first(chunk);
    }
    record["case"] = source.of.bundle;
    record["split"] = source.of.split;
    record["exercise"] = set_up.exercise.name;
    record["machine"] = set_up.machine;
    record["model"] = plan.recipe.model;
    record["depth_mm"] = set_up.exercise.probe.depth_mm;
    record["gauge"] = set_up.exercise.needle.gauge;
    record["gain_db"] = drawn.input.settings.gain_db;
    record["noise_frame"] = drawn.input.frame;
    record["on_skin"] = drawn.on_skin;
    // Millimetres of the plane (x along the face, z into the body) from pixels, and the probe.
    record["mm_per_px"] = layout.mm_per_px;
    record["origin_px"] = {layout.origin_x_px, layout.origin_y_px};
    const Probe& probe = set_up.exercise.probe;
    Json shape = {{"shape", probe_shape_name(probe.shape)}};
    if (probe.shape != ProbeShape::curvilinear) shape["width_mm"] = probe.width_mm;
    if (probe.shape == ProbeShape::curvilinear) shape["radius_mm"] = probe.radius_mm;
    if (probe.shape != ProbeShape::linear)
        shape["field_of_view_deg"] = probe.field_of_view_rad * kDegPerRad;
    shape["frequency_mhz"] = probe.frequency_mhz;
    record["probe"] = std::move(shape);
    return record;
}

// The arrays of a chunk in format npy.
struct ChunkArrays {
    std::vector<std::uint8_t> images, labels, needle, shadowed, lesions, depth;

    void add(const std::vector<std::uint8_t>& picture, const TruthPlaneBuffers& planes) {
        const auto append = [](auto& to, const auto& from) {
            const auto* bytes = reinterpret_cast<const std::uint8_t*>(from.data());
            to.insert(to.end(), bytes, bytes + from.size() * sizeof from[0]);
        };
        append(images, picture);
        append(labels, planes.labels);
        append(needle, planes.needle);
        append(shadowed, planes.shadowed);
        append(lesions, planes.lesions);
        append(depth, planes.skin_depth_mm);
    }

    Status write(const DatasetPlan& plan, std::uint64_t chunk) const {
        const std::size_t width = plan.recipe.width_px, height = plan.recipe.height_px;
        const std::vector<std::size_t> shape{images.size() / (width * height), height, width};
        const auto one = [&](const char* kind, const char* type, const auto& bytes) {
            return write_npy(plan.folder + "/arrays/" + kind + "_" + numbered(chunk, 6) + ".npy",
                             type, shape, bytes);
        };
        for (const Status& done : {one("images", "|u1", images), one("labels", "|u1", labels),
                                   one("needle", "|u1", needle), one("shadow", "|u1", shadowed),
                                   one("lesions", "|u1", lesions), one("depth", "<f4", depth)}) {
            if (!done) return done;
        }
        return Done{};
    }
};

}  // namespace

std::string DatasetPlan::records_path(std::uint64_t chunk) const {
    return folder + "/records/" + numbered(chunk, 6) + ".jsonl";
}

Status make_chunk(const DatasetPlan& plan, const DatasetSource& source, std::uint64_t chunk) {
    const DatasetRecipe& r = plan.recipe;
    SONOCASE_TRY(const ChunkSetUp set_up, set_up_of(plan, source, chunk));
    PlayerArguments arguments;
    ImageChoice image;
    image.model = r.model;
    image.machine = set_up.machine;
    image.effects = set_up.exercise.effects;
    image.width_px = r.width_px;
    image.height_px = r.height_px;
    SONOCASE_TRY(ScanEngine engine, make_engine(*source.open, set_up.exercise, arguments, image));
    SONOCASE_TRY(auto truth, TruthRenderer::create(source.open->bundle, engine.exercise(),
                                                   engine.render_options()));

    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(r.width_px) * r.height_px);
    TruthPlaneBuffers planes(r.width_px, r.height_px);
    ChunkArrays arrays;
    std::string records;
    for (std::uint64_t frame = plan.first(chunk); frame < plan.last(chunk); ++frame) {
        const DrawnFrame drawn =
            draw_frame(r, *source.open->bundle, *source.areas, set_up.exercise, plan.seed, frame);
        FrameRecord again;
        again.input = drawn.input;
        const FrameStatus status = engine.frame_again(again, pixels);
        if (Status read = bundle_health(*source.open); !read) return read;
        const FrameTruth& facts = truth.render(drawn.input, planes.planes(), &engine.renderer());
        std::string line =
            record_of(plan, source, set_up, chunk, frame, drawn, engine.renderer().layout()).dump();
        line.pop_back();
        records += line + ",\"truth\":" +
                   truth_json(facts, static_cast<int>(frame), status, source.open->bundle->labels,
                              set_up.exercise) +
                   "}\n";
        if (r.format == "npy") {
            arrays.add(pixels, planes);
            continue;
        }
        const std::string name = numbered(frame, 8);
        if (Status done = write_png(plan.folder + "/frames/image_" + name + ".png", r.width_px,
                                    r.height_px, 1, pixels);
            !done)
            return done;
        if (Status done = planes.write(plan.folder + "/frames", name); !done) return done;
    }
    if (r.format == "npy") {
        if (Status done = arrays.write(plan, chunk); !done) return done;
    }
    return write_file(plan.records_path(chunk), records);
}

namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// How many records a chunk has; 0: none yet.
std::uint64_t records_of(const DatasetPlan& plan, std::uint64_t chunk) {
    const Result<std::string> text = read_text_file(plan.records_path(chunk));
    if (!text) return 0;
    return static_cast<std::uint64_t>(std::count(text->begin(), text->end(), '\n'));
}

bool is_whole(const DatasetPlan& plan, std::uint64_t chunk) {
    return records_of(plan, chunk) == plan.last(chunk) - plan.first(chunk);
}

Result<std::vector<DatasetSource>> open_sources(const DatasetPlan& plan,
                                                const std::string& recipe_path) {
    const fs::path beside = fs::path(recipe_path).parent_path();
    std::vector<DatasetSource> sources;
    std::shared_ptr<const PhysicalTextures> textures;
    for (const DatasetCase& one : plan.recipe.cases) {
        const fs::path path(one.bundle);
        SONOCASE_TRY(auto open, open_case((path.is_absolute() ? path : beside / path).string()));
        if (textures == nullptr && plan.recipe.model == "physical")
            textures = make_physical_textures();
        open->textures = textures;
        for (const std::string& name : one.exercises) {
            SONOCASE_TRY_DONE(find_exercise(*open, name));
        }
        DatasetSource source{one, std::move(open), nullptr};
        source.areas = std::make_unique<SkinAreas>(source.open->bundle->patient_skin);
        if (plan.recipe.region == "skin" && source.areas->sums.empty()) {
            return Error{"the bundle holds no skin surface", source.open->path,
                         "use region = \"sweeps\", or cook the case again"};
        }
        sources.push_back(std::move(source));
    }
    return sources;
}

// What the whole data set has in common; the same bytes for every shard.
std::string description_of(const DatasetPlan& plan,
                           const std::string& recipe_text,
                           const std::vector<DatasetSource>& sources) {
    Json cases = Json::array();
    for (const DatasetSource& source : sources) {
        Json labels = Json::array();
        for (const Label& label : source.open->bundle->labels)
            labels.push_back({{"name", label.name}, {"tissue", label.tissue}});
        cases.push_back({{"bundle", source.of.bundle},
                         {"name", source.open->bundle->manifest.case_name},
                         {"split", source.of.split},
                         {"labels", std::move(labels)}});
    }
    const Json description = {{"name", plan.recipe.name},
                              {"seed", plan.seed},
                              {"size", {plan.recipe.width_px, plan.recipe.height_px}},
                              {"format", plan.recipe.format},
                              {"cases", std::move(cases)},
                              {"recipe", recipe_text}};
    return description.dump(2) + "\n";
}

Status describe(const DatasetPlan& plan, const std::string& text) {
    const std::string path = plan.folder + "/dataset.json";
    std::error_code failed;
    if (fs::exists(path, failed)) {
        SONOCASE_TRY(const std::string before, read_text_file(path));
        if (before == text) return Done{};
        return Error{"the folder holds another data set", path,
                     "give the recipe, cases and seed that it was begun with, or another folder"};
    }
    return write_file(path, text);
}

// All records in order, once every chunk is whole.
Status write_manifest(const DatasetPlan& plan) {
    std::string manifest;
    for (std::uint64_t chunk = 0; chunk < plan.chunks(); ++chunk) {
        if (!is_whole(plan, chunk)) return Done{};  // another shard is at work
        SONOCASE_TRY(const std::string records, read_text_file(plan.records_path(chunk)));
        manifest += records;
    }
    return write_file(plan.folder + "/manifest.jsonl", manifest);
}

Status make_folders(const DatasetPlan& plan) {
    for (const std::string& name :
         {std::string("records"), std::string(plan.recipe.format == "png" ? "frames" : "arrays")}) {
        std::error_code failed;
        fs::create_directories(plan.folder + "/" + name, failed);
        if (failed) {
            return Error{"cannot make the folder: " + failed.message(), plan.folder + "/" + name,
                         "check the path and its permissions"};
        }
    }
    remove_leftovers(plan.folder);
    return Done{};
}

}  // namespace

Status make_dataset(const DatasetArguments& arguments,
                    const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
    SONOCASE_TRY(const std::string text, read_text_file(arguments.recipe));
    SONOCASE_TRY(DatasetRecipe recipe, parse_dataset_recipe(text, arguments.recipe));
    const DatasetPlan plan{std::move(recipe), arguments.out, arguments.seed, arguments.frames};
    for (const std::string& machine : plan.recipe.machines) {
        SONOCASE_TRY_DONE(load_machine(machine));
    }
    SONOCASE_TRY(std::vector<DatasetSource> sources, open_sources(plan, arguments.recipe));
    if (Status made = make_folders(plan); !made) return made;
    if (Status done = describe(plan, description_of(plan, text, sources)); !done) return done;

    const auto shards = static_cast<std::uint64_t>(arguments.shards);
    const auto first = static_cast<std::uint64_t>(arguments.shard - 1);
    const std::uint64_t mine =
        plan.chunks() > first ? (plan.chunks() - first + shards - 1) / shards : 0;
    for (std::uint64_t n = 0; n < mine; ++n) {
        const std::uint64_t chunk = first + n * shards;
        if (!is_whole(plan, chunk)) {
            if (Status done = make_chunk(plan, sources[plan.case_of(chunk)], chunk); !done)
                return done;
        }
        if (progress) progress(n + 1, mine);
    }
    return write_manifest(plan);
}

}  // namespace sonocase::runtime::inline player_headless
