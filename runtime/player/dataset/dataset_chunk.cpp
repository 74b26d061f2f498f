// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/dataset/dataset_chunk.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "formats/files/atomic_file.h"
#include "runtime/player/dataset/array_file.h"
#include "runtime/player/headless/truth_files.h"
#include "runtime/player/session/case_set_up.h"
#include "runtime/player/session/pictures/png_file.h"

namespace sonocase::runtime {
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
        const Result<int> found = find_exercise(*source.open, names[draw.below(names.size())]);
        if (!found) return found.error();
        set_up.exercise = source.open->exercises[static_cast<std::size_t>(*found)];
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
               const DrawnFrame& drawn) {
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
    return record;
}

// The arrays of a chunk in format npy.
struct ChunkArrays {
    std::vector<std::uint8_t> images, labels, needle, shadowed, depth;

    void add(const std::vector<std::uint8_t>& picture, const TruthPlaneBuffers& planes) {
        const auto append = [](auto& to, const auto& from) {
            const auto* bytes = reinterpret_cast<const std::uint8_t*>(from.data());
            to.insert(to.end(), bytes, bytes + from.size() * sizeof from[0]);
        };
        append(images, picture);
        append(labels, planes.labels);
        append(needle, planes.needle);
        append(shadowed, planes.shadowed);
        append(depth, planes.skin_depth_mm);
    }

    Status write(const DatasetPlan& plan, std::uint64_t chunk) const {
        const auto width = static_cast<std::size_t>(plan.recipe.width_px),
                   height = static_cast<std::size_t>(plan.recipe.height_px);
        const std::vector<std::size_t> shape{images.size() / (width * height), height, width};
        const auto one = [&](const char* kind, const char* type, const auto& bytes) {
            return write_npy(plan.folder + "/arrays/" + kind + "_" + numbered(chunk, 6) + ".npy",
                             type, shape, bytes);
        };
        for (const Status& done : {one("images", "|u1", images), one("labels", "|u1", labels),
                                   one("needle", "|u1", needle), one("shadow", "|u1", shadowed),
                                   one("depth", "<f4", depth)}) {
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
    const Result<ChunkSetUp> set_up = set_up_of(plan, source, chunk);
    if (!set_up) return set_up.error();
    PlayerArguments arguments;
    ImageChoice image;
    image.model = r.model;
    image.machine = set_up->machine;
    image.effects = set_up->exercise.effects;
    image.width_px = r.width_px;
    image.height_px = r.height_px;
    Result<ScanEngine> engine = make_engine(*source.open, set_up->exercise, arguments, image);
    if (!engine) return engine.error();
    auto truth =
        TruthRenderer::create(source.open->bundle, engine->exercise(), engine->render_options());
    if (!truth) return truth.error();

    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(r.width_px) *
                                     static_cast<std::size_t>(r.height_px));
    TruthPlaneBuffers planes(r.width_px, r.height_px);
    ChunkArrays arrays;
    std::string records;
    for (std::uint64_t frame = plan.first(chunk); frame < plan.last(chunk); ++frame) {
        const DrawnFrame drawn =
            draw_frame(r, *source.open->bundle, *source.areas, set_up->exercise, plan.seed, frame);
        FrameRecord again;
        again.input = drawn.input;
        const FrameStatus status = engine->frame_again(again, pixels);
        if (Status read = bundle_health(*source.open); !read) return read;
        const FrameTruth& facts = truth->render(drawn.input, planes.planes());
        std::string line = record_of(plan, source, *set_up, chunk, frame, drawn).dump();
        line.pop_back();
        records += line + ",\"truth\":" +
                   truth_json(facts, static_cast<int>(frame), status, source.open->bundle->labels,
                              set_up->exercise) +
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

}  // namespace sonocase::runtime
