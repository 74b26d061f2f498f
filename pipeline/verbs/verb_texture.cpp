// SPDX-License-Identifier: Apache-2.0

// sonocase texture: learns solid textures from example images, or makes the whole bank.
//
// Not the verb that a descriptor would give the stage "texture": it takes images in place of a
// case's tissues, may write pictures or a report alone, and measures the quality of every texture.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <optional>

#include "formats/bundle/stage_files.h"
#include "formats/files/load_save.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/parallel.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/texture_stage.h"
#include "pipeline/texture/read_example.h"
#include "pipeline/texture/speckle_volume.h"
#include "pipeline/texture/texture_quality.h"
#include "pipeline/verbs/stage_verb.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {
namespace {

struct TextureArguments {
    StageSettings settings{built_in_stages()};
    std::vector<std::string> images;  // FILE or NAME=FILE
    std::string folder, out, pictures, mask, third_axis;
    std::vector<int> rectangle;  // x, y, width, height
    int frame = 0;
    CommonOptions common;

    const TextureStageOptions& options() const { return settings.of<TextureStageOptions>(); }
    std::uint64_t seed() const { return case_seed(settings); }
};

void add_files(CLI::App& app, TextureArguments& a) {
    app.add_option("examples", a.images,
                   "Images: FILE, or NAME=FILE; files of one name make one texture")
        ->type_name("[NAME=]FILE");
    app.add_option("--examples", a.folder,
                   "Folder with patches.csv (columns file, class) for the bank")
        ->type_name("DIR");
    app.add_option("-o,--output", a.out, "Where to write the textures")->type_name("OUT.textures");
    app.add_option("--pictures", a.pictures,
                   "Folder for one page of pictures and plots per texture")
        ->type_name("DIR");
}

void add_image_options(CLI::App& app, TextureArguments& a) {
    const char* const images = "Example images";
    app.add_option("--rectangle", a.rectangle, "Part of each image: x,y,width,height in pixels")
        ->delimiter(',')
        ->expected(4)
        ->type_name("X,Y,W,H")
        ->group(images);
    app.add_option("--mask", a.mask, "Image of the same size: bright pixels are the example")
        ->type_name("FILE")
        ->group(images);
    app.add_option("--frame", a.frame, "Which image of a file with several")
        ->check(CLI::Range(0, 100000))
        ->capture_default_str()
        ->group(images);
    app.add_option("--third-axis", a.third_axis,
                   "Out of the picture as across the main direction (fibres) or along it (speckle, "
                   "septa); default: along, or what the built-in texture has")
        ->check(CLI::IsMember({"across", "along"}))
        ->group(images);
}

// What is wrong with the combination of flags; empty: nothing.
std::string misuse(const TextureArguments& a) {
    if (a.out.empty() && a.pictures.empty() && a.common.report_path.empty())
        return "nothing to write: give -o, --pictures or --report";
    if (a.images.empty() && (!a.rectangle.empty() || !a.mask.empty()))
        return "--rectangle and --mask need an image to cut from";
    if (!a.images.empty() && !a.folder.empty()) return "give images or --examples, not both";
    return "";
}

// The textures that the images are examples of; images of one name make one.
Result<std::vector<TextureSpec>> specs_of_images(const TextureArguments& a,
                                                 const TextureBankOptions& bank,
                                                 std::vector<std::string>* notes) {
    ReadExampleOptions read;
    read.frame = a.frame;
    read.mask_path = a.mask;
    if (a.rectangle.size() == 4)
        read.rectangle =
            PixelRectangle{a.rectangle[0], a.rectangle[1], a.rectangle[2], a.rectangle[3]};
    std::vector<TextureSpec> specs;
    for (const std::string& image : a.images) {
        const std::size_t equals = image.find('=');
        const bool named = equals != std::string::npos;
        const std::string path = named ? image.substr(equals + 1) : image;
        const std::string name =
            named ? image.substr(0, equals) : std::filesystem::path(path).stem().string();
        SONOCASE_TRY(auto example, read_example(path, read, notes));
        auto same = std::find_if(specs.begin(), specs.end(),
                                 [&](const TextureSpec& s) { return s.name == name; });
        if (same == specs.end()) {
            TextureSpec spec;
            spec.name = name;
            spec.mode = bank.mode;
            spec.pyramid = bank.pyramid;
            spec.edge = bank.edge;
            spec.pixel_mm = bank.pixel_mm;
            spec.seed = bank.seed;
            spec.third_axis = ThirdAxis::along;
            same = specs.insert(specs.end(), std::move(spec));
        }
        same->examples.push_back(std::move(example));
    }
    return specs;
}

Result<std::vector<TextureSpec>> specs_of(const TextureArguments& a,
                                          std::vector<std::string>* notes) {
    TextureBankOptions bank = bank_options(a.options(), a.seed());
    bank.example_folder = a.folder;
    auto specs = a.images.empty() ? plan_texture_bank(built_in_tissues(), bank, notes)
                                  : specs_of_images(a, bank, notes);
    if (specs && !a.third_axis.empty())
        for (TextureSpec& spec : *specs)
            spec.third_axis = a.third_axis == "across" ? ThirdAxis::across : ThirdAxis::along;
    return specs;
}

// Each texture with its quality, in the order of the specs.
Result<std::vector<TextureAssessment>> assess(const std::vector<TextureSpec>& specs,
                                              const CommonOptions& common) {
    std::vector<std::optional<Result<TextureAssessment>>> assessed(specs.size());
    {
        ProgressBar bar(common);
        report_progress(bar.progress(), 0.2, "learning textures");
        parallel_for(specs.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) assessed[i].emplace(assess_texture(specs[i]));
        });
    }
    std::vector<TextureAssessment> all;
    for (auto& one : assessed) {
        if (!*one) return one->error();
        all.push_back(std::move(**one));
    }
    return all;
}

void add_to_report(const std::vector<TextureAssessment>& textures, StageReport& report) {
    for (const TextureAssessment& texture : textures) {
        for (const Measure& m : texture.measures()) report.measures.push_back(m);
        report.warnings.insert(report.warnings.end(), texture.made.warnings.begin(),
                               texture.made.warnings.end());
    }
}

Status draw_pages(const std::vector<TextureAssessment>& textures, const std::string& folder) {
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed) return Error{"the folder cannot be created", folder, "choose another"};
    for (const TextureAssessment& texture : textures) {
        const auto page = std::filesystem::path(folder) / (texture.made.texture.name + ".png");
        if (auto status = write_texture_page(texture, page.string()); !status) return status;
    }
    return Done{};
}

Status write_textures(const TextureArguments& a,
                      const std::vector<TextureAssessment>& textures,
                      const StageReport& report) {
    if (!a.pictures.empty())
        if (auto status = draw_pages(textures, a.pictures); !status) return status;
    if (!a.out.empty()) {
        TextureFile file;
        for (const TextureAssessment& texture : textures)
            file.textures.push_back(texture.made.texture);
        const int speckle_edge = a.options().speckle_edge;
        if (speckle_edge > 0) file.speckle = make_speckle(speckle_edge, a.seed());
        const auto tissues = built_in_tissues();
        if (a.images.empty()) file.tissues.assign(tissues.begin(), tissues.end());
        file.reports = without_seconds({report});
        if (auto status = save_texture_file(file, a.out); !status) return status;
    }
    return write_report(a.common, report);
}

}  // namespace

int verb_texture(int argc, char** argv) {
    CLI::App app(
        "Learn solid textures from example images. Without examples: the bank of the built-in\n"
        "tissue table, from a folder of patches or from synthetic examples");
    TextureArguments a;
    a.settings.of<TextureStageOptions>().speckle_edge = 0;  // textures alone
    add_files(app, a);
    const StageTable& table = a.settings.table();
    add_option_flags(app, table.options_of<TextureStageOptions>(), a.settings);
    add_option_flags(app, table.common, a.settings);
    add_image_options(app, a);
    add_common_options(app, a.common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    if (const std::string wrong = misuse(a); !wrong.empty()) return wrong_usage("texture", wrong);
    const ThreadLimit limit(a.common.threads);
    const Stopwatch watch;
    StageReport report;
    report.stage = stage_names::kTexture;
    const auto specs = specs_of(a, &report.warnings);
    if (!specs) return fail("texture", specs.error());
    const auto textures = assess(*specs, a.common);
    if (!textures) return fail("texture", textures.error());
    add_to_report(*textures, report);
    report.seconds = watch.seconds();
    print_warnings("texture", report);
    if (auto status = write_textures(a, *textures, report); !status)
        return fail("texture", status.error());
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
