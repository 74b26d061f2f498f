// SPDX-License-Identifier: Apache-2.0

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "formats/files/bundle_file.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/recipe/read_recipe.h"
#include "pipeline/texture/example/read_example.h"
#include "pipeline/tradeoff/suites.h"
#include "pipeline/tradeoff/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

constexpr int kFrames = 12;

// The player runs as a program of its own: pipeline and runtime do not link each other.
struct Player {
    std::string program, bundle;
    TemporaryFolder folder;
    std::vector<ExampleImage> finest;
    bool linear = false;  // a linear probe in place of each exercise's own
};

std::string quoted(const std::string& text) {
    std::string out = "'";
    for (char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
}

// The exercise with a linear probe in place of its own.
std::string with_linear_probe(const std::string& toml) {
    const std::size_t table = toml.find("[probe]"), end = toml.find("\n\n", table);
    if (table == std::string::npos || end == std::string::npos) return toml;
    return toml.substr(0, table) +
           "[probe]\nshape = \"linear\"\nwidth_mm = 38\ndepth_mm = 36\nfrequency_mhz = 9\n"
           "focus_mm = 20\nelevation_mm = 2" +
           toml.substr(end);
}

Status start(Player& player) {
    std::error_code failed;
    const auto self = std::filesystem::read_symlink("/proc/self/exe", failed);
    player.program = (self.parent_path() / "sonoplay").string();
    if (failed || !std::filesystem::exists(player.program)) {
        return Error{"the player is not beside this program", player.program,
                     "build or install sonoplay, or leave --suite render out"};
    }
    if (const Status s = player.folder.make("sonocase-render"); !s) return s.error();
    auto recipe = embedded_recipe();
    if (!recipe) return recipe.error();
    auto cooked = cook_case(*recipe);
    if (!cooked) return cooked.error();
    if (player.linear) {
        for (EmbeddedExercise& exercise : cooked->bundle.exercises)
            exercise.toml = with_linear_probe(exercise.toml);
    }
    player.bundle = player.folder.path() + "/demo.sonocase";
    return save_bundle(cooked->bundle, player.bundle);
}

// Frames of a sweep under the settings, and the median time of one, its truth planes included where
// they are asked for.
Result<std::vector<ExampleImage>> play(const Player& player,
                                       const Settings& settings,
                                       double* seconds) {
    const std::string out = player.folder.path() + "/frames",
                      stats = player.folder.path() + "/stats.json";
    std::string command = quoted(player.program) + " " + quoted(player.bundle) +
                          " --headless --tracker sweep:tour --frames " + std::to_string(kFrames) +
                          " --out " + quoted(out) + " --stats " + quoted(stats);
    for (const Setting& s : settings) {
        const std::string name = s.key.substr(s.key.find('.') + 1);
        if (name == "labels") {
            if (s.value == "on") command += " --truth " + quoted(player.folder.path() + "/truth");
            continue;
        }
        const bool grain = name == "grain_db", even = name == "equalisation",
                   reduction = name == "speckle_reduction";
        if (name == "aperture_mm" || grain || even || reduction) {
            const std::string machine = player.folder.path() + "/machine.toml";
            const std::string text =
                grain ? "[machine]\nbase = \"modern-linear\"\nname = \"grain\"\n"
                        "[machine.noise]\ngrain_db = " +
                            s.value + "\n"
                : even      ? "[machine.equalisation]\namount = " + s.value + "\n"
                : reduction ? "[machine.speckle_reduction]\nvariation = " + s.value + "\n"
                            : "[machine.beam]\naperture_mm = " + s.value + "\n";
            if (const Status w = write_file(machine, text); !w) return w.error();
            command += " --machine " + quoted(machine);
            continue;
        }
        command += " --" + name + "=" + quoted(s.value);
    }
    if (std::system((command + " >/dev/null 2>&1").c_str()) != 0) {
        return Error{"the player failed", command, "run it to see why"};
    }
    const auto text = read_text_file(stats);
    if (!text) return text.error();
    const auto json = nlohmann::json::parse(*text, nullptr, false);
    if (json.is_discarded()) return Error{"is not JSON", stats, ""};
    *seconds = json["frame_ms"].value("median", 0.0) * 1e-3;
    if (json.contains("truth_ms")) *seconds += json["truth_ms"].value("median", 0.0) * 1e-3;
    std::vector<ExampleImage> frames;
    for (int i = 0; i < kFrames; ++i) {
        char name[32];
        std::snprintf(name, sizeof name, "/frame_%05d.png", i);
        auto frame = read_example(out + name);
        if (!frame) return frame.error();
        frames.push_back(std::move(*frame));
    }
    return frames;
}

// Root mean square difference in grey after averaging over 8 x 8 pixels: what is where and how
// bright, and not the place of each grain of speckle, which any change of sampling moves.
double rms_grey(const std::vector<ExampleImage>& a, const std::vector<ExampleImage>& b) {
    constexpr int kBlock = 8;
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t f = 0; f < a.size(); ++f) {
        for (int y = 0; y + kBlock <= a[f].height; y += kBlock) {
            for (int x = 0; x + kBlock <= a[f].width; x += kBlock) {
                double difference = 0;
                for (int v = 0; v < kBlock; ++v) {
                    for (int u = 0; u < kBlock; ++u) {
                        const std::size_t i = a[f].index(x + u, y + v);
                        difference +=
                            static_cast<double>(a[f].grey[i]) - static_cast<double>(b[f].grey[i]);
                    }
                }
                difference /= kBlock * kBlock;
                sum += difference * difference;
                ++count;
            }
        }
    }
    return std::sqrt(sum / static_cast<double>(count));
}

// Against the finest sampling. suite: prefix of the knobs' names.
std::function<Result<Measured>(const Settings&)> against_the_finest(
    const std::shared_ptr<Player>& player, const std::string& suite) {
    return [player, suite](const Settings& settings) -> Result<Measured> {
        if (player->bundle.empty()) {
            if (const Status s = start(*player); !s) return s.error();
        }
        double seconds = 0;
        const Settings finest{
            {suite + ".scanlines", "768"}, {suite + ".samples", "1024"}, {suite + ".looks", "16"}};
        if (player->finest.empty()) {
            auto frames = play(*player, finest, &seconds);
            if (!frames) return frames.error();
            player->finest = std::move(*frames);
        }
        const auto frames = play(*player, settings, &seconds);
        if (!frames) return frames.error();
        return Measured{rms_grey(*frames, player->finest), seconds, ""};
    };
}

}  // namespace

Suite linear_suite() {
    auto player = std::make_shared<Player>();
    player->linear = true;
    Suite suite;
    suite.name = "linear";
    suite.title = "A linear picture of the physical model";
    suite.body = "demo-torso";
    suite.error_name = "rms difference";
    suite.error_unit = "grey, 8 x 8 pixels averaged";
    suite.truth =
        "Twelve frames of a sweep over the demo torso with a linear probe (38 mm, 9 MHz) are "
        "compared with the same frames at 768 beams of 1024 samples and 16 looks; seconds are the "
        "median of a frame on one thread.";
    suite.knobs = {
        {"linear.looks",
         {"1", "2", "4", "6", "16"},
         "4",
         "",
         "speckle fields that are averaged",
         "grain of the ground between plates",
         "the machine's own are 4, and 5 in the first 8 mm"},
        {"linear.grain_db",
         {"0", "0.6", "1.3", "2", "3"},
         "1.3",
         "dB",
         "deviation of a sample's own gain",
         "grain of single samples that grows with the echo, as real images have",
         "modern-linear has 1.3; averaged over 8 x 8 pixels it hardly shows"},
        {"linear.effects",
         {"auto", "-streaks", "-fine_structure", "-wall", "-structure"},
         "auto",
         "",
         "effects that are left out",
         "septa and perimysium, the ground of muscle and fat, sheets of the wall",
         "without plates muscle and fat are even"},
    };
    suite.measure = against_the_finest(player, suite.name);
    return suite;
}

Suite render_suite() {
    auto player = std::make_shared<Player>();
    Suite suite;
    suite.name = "render";
    suite.title = "A frame of the physical model";
    suite.body = "demo-torso";
    suite.error_name = "rms difference";
    suite.error_unit = "grey, 8 x 8 pixels averaged";
    suite.truth =
        "Twelve frames of a sweep over the demo torso are compared with the same frames at 768 "
        "beams of 1024 "
        "samples; seconds are the median of a frame on one thread.";
    suite.knobs = {
        {"render.scanlines",
         {"64", "96", "128", "176", "256", "384"},
         "176",
         "",
         "beams of the sector",
         "detail across the beams",
         "the lateral filter spans a number of beams, so few beams also change the grain"},
        {"render.samples",
         {"128", "256", "384", "416", "512", "768"},
         "416",
         "",
         "samples along a beam",
         "detail along the beam",
         "two samples to the point spread's width along the beam are the player's choice"},
        {"render.looks",
         {"1", "2", "3", "4", "6", "16"},
         "2",
         "",
         "speckle fields that are averaged",
         "grain of the speckle",
         "a look costs some 5 % of a frame; fewer make the speckle more contrasty"},
        {"render.aperture_mm",
         {"0", "8", "17", "30"},
         "17",
         "",
         "width of the face that listens",
         "the penumbra of shadows",
         "costs one pass over the light of all samples, as much at every width but 0"},
        {"render.equalisation",
         {"0", "0.25", "0.5", "1"},
         "1",
         "",
         "how far a beam's gain goes to its neighbours'",
         "upright columns in the liver: of shadows, and of bright and dark places",
         "costs the sum of cells and a product of all samples, as much at every amount but 0"},
        {"render.speckle_reduction",
         {"0", "0.15", "0.3", "0.6"},
         "0.3",
         "",
         "how much the contrast of detail differs between places of the tissue",
         "smooth regions beside busy ones",
         "costs the sum of cells and a blend of all samples, as much at every value but 0"},
        {"render.effects",
         {"auto", "-deformation", "-wall", "-streaks", "-parenchyma,-fine_structure", "-structure",
          "-clutter", "-boundaries"},
         "auto",
         "",
         "effects that are left out",
         "what that effect shows",
         "what a scene does not show is not paid for in the first place"},
        {"render.labels",
         {"off", "on"},
         "off",
         "",
         "truth of every pixel beside the picture",
         "nothing: the picture is the same",
         "labels, needle, shadow and depth cost about as much as a frame, and nothing when off"},
    };
    suite.pairs = {{"render.scanlines", "render.samples"}};
    suite.named = {{TrialRole::paper, "model paper", {{"render.model", "paper"}}},
                   {TrialRole::peer, "reference renderer", {{"render.renderer", "reference"}}}};
    suite.measure = against_the_finest(player, suite.name);
    return suite;
}

}  // namespace sonocase::pipeline
