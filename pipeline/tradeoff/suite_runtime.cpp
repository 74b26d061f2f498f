// SPDX-License-Identifier: Apache-2.0

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <nlohmann/json.hpp>

#include "formats/base/constants.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/scoring/free_fluid.h"
#include "pipeline/base/program_beside.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/texture/read_example.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {

namespace {

constexpr int kFrames = 12;

// The player that lies beside this program, and what it plays.
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
    SONOCASE_TRY_DONE(player.folder.make("sonocase-render"));
    SONOCASE_TRY(auto recipe, embedded_recipe());
    SONOCASE_TRY(auto cooked, cook_case(recipe));
    if (player.linear) {
        for (EmbeddedExercise& exercise : cooked.bundle.exercises)
            exercise.toml = with_linear_probe(exercise.toml);
    }
    player.bundle = player.folder.path() + "/demo.sonocase";
    return save_bundle(cooked.bundle, player.bundle);
}

// Returns the frames of a sweep under the settings, and the median time of a frame, with its truth
// planes if the settings ask for them.
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
            SONOCASE_TRY_DONE(write_file(machine, text));
            command += " --machine " + quoted(machine);
            continue;
        }
        command += " --" + name + "=" + quoted(s.value);
    }
    if (std::system((command + " >/dev/null 2>&1").c_str()) != 0) {
        return Error{"the player failed", command, "run it to see why"};
    }
    SONOCASE_TRY(const auto text, read_text_file(stats));
    const auto json = nlohmann::json::parse(text, nullptr, false);
    if (json.is_discarded()) return Error{"is not JSON", stats, ""};
    *seconds = json["frame_ms"].value("median", 0.0) * 1e-3;
    if (json.contains("truth_ms")) *seconds += json["truth_ms"].value("median", 0.0) * 1e-3;
    std::vector<ExampleImage> frames;
    for (int i = 0; i < kFrames; ++i) {
        char name[32];
        std::snprintf(name, sizeof name, "/frame_%05d.png", i);
        SONOCASE_TRY(auto frame, read_example(out + name));
        frames.push_back(std::move(frame));
    }
    return frames;
}

// The root mean square difference in grey after averaging over 8 x 8 pixels. It compares places and
// brightness, not single grains of speckle, which any change of sampling moves.
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

// Measures settings against the finest sampling. suite: the prefix of the knobs' names.
std::function<Result<Measured>(const Settings&)> against_the_finest(
    const std::shared_ptr<Player>& player, const std::string& suite) {
    return [player, suite](const Settings& settings) -> Result<Measured> {
        if (player->bundle.empty()) {
            SONOCASE_TRY_DONE(start(*player));
        }
        double seconds = 0;
        const Settings finest{
            {suite + ".scanlines", "768"}, {suite + ".samples", "1024"}, {suite + ".looks", "16"}};
        if (player->finest.empty()) {
            SONOCASE_TRY(auto frames, play(*player, finest, &seconds));
            player->finest = std::move(frames);
        }
        SONOCASE_TRY(const auto frames, play(*player, settings, &seconds));
        return Measured{rms_grey(frames, player->finest), seconds, ""};
    };
}

}  // namespace

namespace {

// What the player says of its effects: name, and what --measure-effects measured.
struct MeasuredEffects {
    struct Effect {
        std::string name, why;
        bool measured = false;
        double ms = 0, noise_ms = 0, changed_part = 0, rms_grey = 0;
    };
    double frame_ms = 0;
    std::vector<Effect> effects;
};

Result<MeasuredEffects> measure_effects() {
    Player started;
    SONOCASE_TRY_DONE(start(started));
    const Player& player = started;
    const std::string stats = player.folder.path() + "/stats.json";
    const std::string command = quoted(player.program) + " " + quoted(player.bundle) +
                                " --headless --tracker sweep:tour --measure-effects --frames " +
                                std::to_string(kFrames) + " --stats " + quoted(stats) +
                                " >/dev/null 2>&1";
    if (std::system(command.c_str()) != 0)
        return Error{"the player failed", command, "run it to see why"};
    SONOCASE_TRY(const auto text, read_text_file(stats));
    const auto json = nlohmann::json::parse(text, nullptr, false);
    if (json.is_discarded() || !json.contains("effects_measured"))
        return Error{"has no measured effects", stats, "use the player of this version"};
    MeasuredEffects all;
    all.frame_ms = json["effects_measured"].value("frame_ms", 0.0);
    for (const auto& effect : json["effects"])
        all.effects.push_back({effect.value("name", ""), effect.value("why", ""),
                               effect.value("cost", "") == "measured", effect.value("ms", 0.0),
                               effect.value("noise_ms", 0.0), effect.value("changed_part", 0.0),
                               effect.value("rms_grey", 0.0)});
    return all;
}

}  // namespace

Suite effects_suite() {
    auto measured = std::make_shared<Result<MeasuredEffects>>(measure_effects());
    Suite suite;
    suite.name = "effects";
    suite.title = "Effects of a frame, each left out";
    suite.body = "demo-torso";
    suite.error_name = "rms change of all scanned pixels";
    suite.error_unit = "grey";
    suite.truth =
        "One renderer draws twelve frames of a sweep over the demo torso in turn with and without "
        "each effect that they call for. Seconds are the processor time of a frame without that "
        "effect, the fastest of eight turns. docs/effects.md has the instruction counts for the "
        "scenes of all scenarios.";
    Knob knob{"effects.left_out",
              {"none"},
              "none",
              "",
              "the effect that is left out",
              "what that effect shows",
              "an effect that changes little may cost much, and one that ends beams saves time"};
    if (*measured)
        for (const MeasuredEffects::Effect& effect : (*measured)->effects)
            if (effect.measured) knob.values.push_back(effect.name);
    suite.knobs = {std::move(knob)};
    suite.measure = [measured](const Settings& settings) -> Result<Measured> {
        if (!*measured) return measured->error();
        const MeasuredEffects& all = **measured;
        if (settings.empty() || settings[0].value == "none")
            return Measured{0, 1e-3 * all.frame_ms, ""};
        for (const MeasuredEffects::Effect& effect : all.effects) {
            if (effect.name != settings[0].value) continue;
            char note[200];
            std::snprintf(note, sizeof note, "%.1f %% of the pixels; +- %.1f %% of a frame; %s",
                          100 * effect.changed_part, 100 * effect.noise_ms / all.frame_ms,
                          effect.why.c_str());
            return Measured{effect.rms_grey, 1e-3 * (all.frame_ms - effect.ms), note};
        }
        return Error{"no effect is called " + settings[0].value, "effects.left_out", ""};
    };
    return suite;
}

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
        "beams of 1024 samples. Seconds are the median of a frame on one thread.";
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
         "width of the receiving aperture",
         "the penumbra of shadows",
         "costs one pass over the light of all samples, as much at every width but 0"},
        {"render.equalisation",
         {"0", "0.25", "0.5", "1"},
         "1",
         "",
         "how far a beam's gain is moved towards its neighbours'",
         "vertical columns in the liver, from shadows and from bright and dark places",
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

namespace {

// Errors and time of the press field on a folder of finite element blocks, measured by the program
// press_block.
Result<Measured> measure(const std::string& blocks, const Settings& settings) {
    if (!std::filesystem::exists(blocks))
        return Error{"no finite element blocks", blocks,
                     "give their folder or its parent as --data"};
    std::string increments = "3", iterations = "12";
    for (const Setting& s : settings) {
        if (s.key == "press.increments") increments = s.value;
        if (s.key == "press.iterations") iterations = s.value;
    }
    const std::string arguments = "'" + blocks + "' '" + increments + "' '" + iterations + "'";
    SONOCASE_TRY(const auto text,
                 output_of_program_beside("press_block", arguments, "leave --suite press out"));
    const auto json = nlohmann::json::parse(text, nullptr, false);
    if (json.is_discarded() || !json.contains("blocks"))
        return Error{"is not the errors of blocks", "press_block " + arguments,
                     "a JSON object with blocks{}"};
    double error = 0, seconds = 0;
    int count = 0;
    for (const auto& block : json["blocks"]) {
        for (const auto& state : block["states"]) {
            if (state.value("pressed_mm", 0.0) > 8.5) continue;
            error += state.value("mean_mm", 0.0);
            ++count;
        }
        seconds += block.value("solve_ms", 0.0) * 1e-3 / static_cast<double>(json["blocks"].size());
    }
    if (count == 0) return Error{"no states", "press_block " + arguments, "states[] of the blocks"};
    return Measured{error / count, seconds, ""};
}

}  // namespace

Suite press_suite(const std::string& data) {
    Suite suite;
    suite.name = "press";
    suite.title = "Tissue under a pressing probe";
    suite.body = "blocks";
    suite.error_name = "mean displacement error";
    suite.error_unit = "mm";
    suite.truth =
        "The truth is the displacement of a nonlinear finite element model at up to 8 mm of "
        "pressing; the error is the mean over the blocks of the data folder. Seconds are those of "
        "the fastest of twenty solutions, including look-ups in the finite elements.";
    suite.knobs = {{"press.increments",
                    {"1", "2", "3", "4", "8"},
                    "3",
                    "",
                    "steps in which the face is pressed in",
                    "moduli are taken at the stress reached",
                    "from three on the model's own error is larger"},
                   {"press.iterations",
                    {"3", "6", "12", "24", "48"},
                    "12",
                    "",
                    "conjugate gradient iterations in each step, a third more in the first",
                    "remaining error of the linear system",
                    "the model's own error is reached at twelve"}};
    suite.pairs = {{"press.increments", "press.iterations"}};
    // The path may name the folder of the blocks or the one that contains it.
    std::error_code failed;
    const std::string within = data + "/deformation";
    const std::string blocks = std::filesystem::exists(within, failed) ? within : data;
    suite.measure = [blocks](const Settings& settings) { return measure(blocks, settings); };
    return suite;
}

namespace {

// Measured by a program that prints error and seconds: doppler_trial, camera_trial.
Result<Measured> trial(const std::string& program, const std::string& arguments, const char* cure) {
    SONOCASE_TRY(const auto text, output_of_program_beside(program, arguments, cure));
    const auto json = nlohmann::json::parse(text, nullptr, false);
    if (json.is_discarded() || !json.contains("error") || !json.contains("seconds"))
        return Error{"is not the error of a trial", program + " " + arguments,
                     "a JSON object with error and seconds"};
    return Measured{json["error"].get<double>(), json["seconds"].get<double>(),
                    json.value("note", "")};
}

Result<Measured> measure(const std::string& arguments) {
    return trial("doppler_trial", arguments, "leave --suite colour and spectrum out");
}

std::string value_of(const Settings& settings, const std::string& key, const char* standard) {
    for (const Setting& s : settings)
        if (s.key == key) return s.value;
    return standard;
}

}  // namespace

Suite colour_suite() {
    Suite suite;
    suite.name = "colour";
    suite.title = "Colour Doppler";
    suite.body = "tube";
    suite.error_name = "noise of the velocity";
    suite.error_unit = "of the Nyquist velocity";
    suite.truth =
        "A tube of 8 mm carries 480 mL/min at 55 degrees, in a box of a third of a sector; the "
        "error is the standard deviation of its cells over forty frames. Seconds are those of the "
        "fastest frame. More pulses lower the machine's frame rate, which the notes give.";
    suite.knobs = {{"colour.ensemble",
                    {"4", "6", "8", "10", "12", "16"},
                    "10",
                    "",
                    "pulses for each line",
                    "noise of the velocity",
                    "no pulse is simulated: more of them cost the machine time, and us none"},
                   {"colour.persistence",
                    {"1", "2", "3", "4"},
                    "2",
                    "",
                    "frames whose noise is blended",
                    "nothing: the noise lasts longer and is as large",
                    "draws are kept from frame to frame"}};
    suite.measure = [](const Settings& settings) {
        return measure("colour " + value_of(settings, "colour.ensemble", "10") + " " +
                       value_of(settings, "colour.persistence", "2"));
    };
    return suite;
}

Suite spectrum_suite() {
    Suite suite;
    suite.name = "spectrum";
    suite.title = "Spectral Doppler";
    suite.body = "tube";
    suite.error_name = "rms error of the peak velocity";
    suite.error_unit = "of the true one";
    suite.truth =
        "The same tube carries an artery's pulse, with a gate of 4 mm in its middle; the error is "
        "the rms error of the peak velocity in 24 times 5 s of spectrum. Seconds are for one line "
        "of the spectrum, of which there are 200 each second; the notes give the bias.";
    suite.knobs = {{"spectrum.gate_points",
                    {"8", "16", "32", "64", "128", "256"},
                    "64",
                    "",
                    "points of the gate",
                    "how finely the gate's velocities are told apart",
                    "what is left beyond 16 is the bins' and the envelope's"}};
    suite.measure = [](const Settings& settings) {
        return measure("spectrum " + value_of(settings, "spectrum.gate_points", "64"));
    };
    return suite;
}

// Root mean square error of the volume below the level, over postures and shares of an ellipsoid,
// whose cut at u of its reach along up leaves (1 + u)^2 (2 - u) / 4 of it.
Measured measure_fluid(int points) {
    std::vector<Label> labels(2);
    labels[1].name = "between";
    FreeFluid fluid;
    fluid.ml = 1200;
    fluid.lies_in = "between";
    fluid.half_mm = {140, 60, 105};
    const Stopwatch making;
    FreeFluidPlace place(
        fluid, [](Point3) { return 1; }, labels, points);
    const double making_s = making.seconds();
    const Vector3 h = fluid.half_mm;
    const double full_ml = 4.0 / 3 * kPi * h.x * h.y * h.z / 1000;
    double square = 0, seconds = 0;
    int count = 0;
    for (double turn = -80; turn <= 80; turn += 20)
        for (const double tilt : {-30.0, 0.0, 25.0})
            for (const double share : {0.02, 0.1, 0.3, 0.6}) {
                const Vector3 up = place.up(turn, tilt);
                const Stopwatch watch;
                const double level = place.level_mm(share * full_ml, up);
                seconds += watch.seconds();
                const double u = level / norm(Vector3{h.x * up.x, h.y * up.y, h.z * up.z});
                const double off = (1 + u) * (1 + u) * (2 - u) / 4 / share - 1;
                square += off * off;
                ++count;
            }
    char note[64];
    std::snprintf(note, sizeof note, "%.2g s once, as the attempt begins", making_s);
    return {100 * std::sqrt(square / count), seconds / count, note};
}

Suite fluid_suite() {
    Suite suite;
    suite.name = "fluid";
    suite.title = "Free fluid";
    suite.body = "ellipsoid";
    suite.error_name = "rms error of the volume";
    suite.error_unit = "%";
    suite.truth =
        "An ellipsoid of 3.7 litres without bowel is filled to 2, 10, 30 and 60 % in 27 postures; "
        "its volume below the level is known in closed form. Seconds are for finding one level, "
        "which happens whenever volume or posture changes.";
    suite.knobs = {{"fluid.points",
                    {"1250", "5000", "20000", "80000"},
                    std::to_string(FreeFluidPlace::kPoints),
                    "",
                    "points that are counted",
                    "apparent volume of the fluid",
                    "how much is left is kept as a number of its own: draining stays exact"}};
    suite.measure = [](const Settings& settings) -> Result<Measured> {
        return measure_fluid(std::stoi(value_of(settings, "fluid.points", "20000")));
    };
    return suite;
}

Suite camera_suite() {
    Suite suite;
    suite.name = "camera";
    suite.title = "One camera and printed markers";
    suite.body = "rendered-pictures";
    suite.error_name = "rms error of the probe's face";
    suite.error_unit = "mm";
    suite.truth =
        "Sixty rendered pictures of 65 degrees across show a body of 40 mm held at random 0.6 m "
        "away, with the probe's face 120 mm from it. Poses for which a second pose fits nearly as "
        "well do not count; the notes give the number of sure poses. Seconds are for one body in "
        "one picture on one core, including detection round it.";
    suite.knobs = {{"camera.width_px",
                    {"640", "960", "1280", "1920"},
                    "1280",
                    "",
                    "width of the pictures",
                    "how closely corners are found",
                    "at 1920 every second pixel is searched, as in the player",
                    "the costs of JPEG and of the search for a tool that is out of view grow with "
                    "the pixels, and few cameras give thirty pictures of 1920 a second"},
                   {"camera.fit_pixels",
                    {"0", "150", "300", "600", "1200"},
                    "600",
                    "",
                    "pixels of a tag that its pattern is fitted to; 0: lines along its edges",
                    "noise of the corners",
                    "tags at 0.6 m have little more than 600 pixels"},
                   {"camera.tags",
                    {"1", "2", "3", "4", "8"},
                    "8",
                    "",
                    "tags of the body that are used",
                    "how the tool's turn is determined",
                    "hardly more than four are in view",
                    "the pictures in which fewer tags leave two poses do not count here"}};
    suite.measure = [](const Settings& settings) {
        return trial("camera_trial",
                     value_of(settings, "camera.width_px", "1280") + " " +
                         value_of(settings, "camera.fit_pixels", "600") + " " +
                         value_of(settings, "camera.tags", "8"),
                     "leave --suite camera out");
    };
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
