// SPDX-License-Identifier: Apache-2.0

// sonocase texture: learns solid textures from example images, or makes the whole bank.
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

#include "formats/bundle/stage_files.h"
#include "formats/files/stage_file.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/parallel.h"
#include "pipeline/command_line/command_line.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/texture/example/read_example.h"
#include "pipeline/texture/speckle.h"
#include "pipeline/texture/texture_pictures.h"
#include "pipeline/texture/texture_quality.h"

namespace sonocase::pipeline {

int verb_texture(int argc, char** argv) {
    CLI::App app(
        "Learn solid textures from example images. Without examples: the bank of the built-in\n"
        "tissue table, from a folder of patches or from synthetic examples");
    std::vector<std::string> inputs;
    std::string folder, out, pictures, mask, mode = "matched", third_axis;
    std::vector<int> rectangle;
    TextureBankOptions options;
    int frame = 0, speckle_edge = 0;
    CommonOptions common;
    app.add_option("examples", inputs,
                   "Images: FILE, or NAME=FILE; files of one name make one texture")
        ->type_name("[NAME=]FILE");
    app.add_option("--examples", folder,
                   "Folder with patches.csv (columns file, class) for the bank")
        ->type_name("DIR");
    app.add_option("-o,--output", out, "Where to write the textures")->type_name("OUT.textures");
    app.add_option("--pictures", pictures, "Folder for a page of pictures and plots a texture")
        ->type_name("DIR");
    app.add_option("--mode", mode, "Autocorrelation and histogram, or the pyramid of eq. (15)")
        ->check(CLI::IsMember({"matched", "pyramid"}))
        ->capture_default_str();
    app.add_option("--edge", options.edge, "Voxels a side")
        ->check(CLI::IsMember({8, 16, 32, 64, 128}))
        ->capture_default_str();
    app.add_option("--pixel-mm", options.pixel_mm, "Size of an example pixel in tissue, mm")
        ->check(CLI::Range(0.01, 10.0))
        ->capture_default_str();
    app.add_option("--seed", options.seed, "Another seed, another texture of the same kind")
        ->capture_default_str();
    app.add_option("--speckle-edge", speckle_edge,
                   "Also a speckle volume of this many voxels a side; 0: none")
        ->check(CLI::IsMember({0, 8, 16, 32, 64, 128, 256}))
        ->capture_default_str();
    const char* const images = "Example images";
    app.add_option("--rectangle", rectangle, "Part of each image: x,y,width,height in pixels")
        ->delimiter(',')
        ->expected(4)
        ->type_name("X,Y,W,H")
        ->group(images);
    app.add_option("--mask", mask, "Image of the same size: bright pixels are the example")
        ->type_name("FILE")
        ->group(images);
    app.add_option("--frame", frame, "Of a file with several images")
        ->check(CLI::Range(0, 100000))
        ->capture_default_str()
        ->group(images);
    app.add_option("--third-axis", third_axis,
                   "Out of the picture as across the main direction (fibres) or along it (speckle, "
                   "septa); default: along, or what the built-in texture has")
        ->check(CLI::IsMember({"across", "along"}))
        ->group(images);
    const char* const pyramid = "Mode pyramid";
    app.add_option("--levels", options.pyramid.levels, "Levels of the pyramid")
        ->check(CLI::Range(1, 5))
        ->capture_default_str()
        ->group(pyramid);
    app.add_option("--weight", options.pyramid.weight, "K_l of eq. (15)")
        ->check(CLI::Range(0.0, 1.0))
        ->capture_default_str()
        ->group(pyramid);
    app.add_flag("--decimate", options.pyramid.decimate, "Halve the resolution from level to level")
        ->group(pyramid);
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    if (out.empty() && pictures.empty() && common.report_path.empty()) {
        return wrong_usage("texture", "nothing to write: give -o, --pictures or --report");
    }
    if (inputs.empty() && (!rectangle.empty() || !mask.empty())) {
        return wrong_usage("texture", "--rectangle and --mask want an image to cut from");
    }
    if (!inputs.empty() && !folder.empty()) {
        return wrong_usage("texture", "give images or --examples, not both");
    }
    options.mode = mode == "pyramid" ? TextureMode::pyramid : TextureMode::matched;
    options.example_folder = folder;
    const ThreadLimit limit(common.threads);
    const Stopwatch watch;
    StageReport report;
    report.stage = "texture";

    std::vector<TextureSpec> specs;
    if (inputs.empty()) {
        auto planned = plan_texture_bank(built_in_tissues(), options, &report.warnings);
        if (!planned) return fail("texture", planned.error());
        specs = std::move(*planned);
    }
    ReadExampleOptions read;
    read.frame = frame;
    read.mask_path = mask;
    if (rectangle.size() == 4) {
        read.rectangle = PixelRectangle{rectangle[0], rectangle[1], rectangle[2], rectangle[3]};
    }
    for (const std::string& input : inputs) {
        const std::size_t equals = input.find('=');
        const std::string path = equals == std::string::npos ? input : input.substr(equals + 1);
        const std::string name = equals == std::string::npos
                                     ? std::filesystem::path(path).stem().string()
                                     : input.substr(0, equals);
        auto example = read_example(path, read, &report.warnings);
        if (!example) return fail("texture", example.error());
        auto same = std::find_if(specs.begin(), specs.end(),
                                 [&](const TextureSpec& s) { return s.name == name; });
        if (same == specs.end()) {
            TextureSpec spec;
            spec.name = name;
            spec.mode = options.mode;
            spec.pyramid = options.pyramid;
            spec.edge = options.edge;
            spec.pixel_mm = options.pixel_mm;
            spec.seed = options.seed;
            spec.third_axis = ThirdAxis::along;
            specs.push_back(std::move(spec));
            same = specs.end() - 1;
        }
        same->examples.push_back(std::move(*example));
    }
    if (!third_axis.empty()) {
        for (TextureSpec& spec : specs) {
            spec.third_axis = third_axis == "across" ? ThirdAxis::across : ThirdAxis::along;
        }
    }

    std::vector<std::optional<Result<TextureAssessment>>> assessed(specs.size());
    {
        ProgressBar bar(common);
        report_progress(bar.progress(), 0.2, "learning textures");
        parallel_for(specs.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) assessed[i].emplace(assess_texture(specs[i]));
        });
    }
    TextureFile file;
    if (!pictures.empty()) {
        std::error_code made;
        std::filesystem::create_directories(pictures, made);
        if (made) {
            return fail("texture", Error{"the folder cannot be made", pictures, "choose another"});
        }
    }
    for (auto& one : assessed) {
        if (!*one) return fail("texture", one->error());
        const TextureAssessment& assessment = **one;
        for (const Measure& m : assessment.measures()) report.measures.push_back(m);
        report.warnings.insert(report.warnings.end(), assessment.made.warnings.begin(),
                               assessment.made.warnings.end());
        if (!pictures.empty()) {
            const std::string page =
                (std::filesystem::path(pictures) / (assessment.made.texture.name + ".png"))
                    .string();
            if (auto s = write_texture_page(assessment, page); !s)
                return fail("texture", s.error());
        }
        file.textures.push_back(assessment.made.texture);
    }
    report.seconds = watch.seconds();
    print_warnings("texture", report);
    if (!out.empty()) {
        if (speckle_edge > 0) file.speckle = make_speckle(speckle_edge, options.seed);
        const auto tissues = built_in_tissues();
        if (inputs.empty()) file.tissues.assign(tissues.begin(), tissues.end());
        file.reports = {report};
        if (auto s = save_texture_file(file, out); !s) return fail("texture", s.error());
    }
    if (auto s = write_report(common, report); !s) return fail("texture", s.error());
    return kDone;
}

}  // namespace sonocase::pipeline
