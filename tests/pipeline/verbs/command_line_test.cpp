// SPDX-License-Identifier: Apache-2.0

// The program sonocase as a user meets it: exit statuses, one-line errors, nothing half-written.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "support/box_mesh.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace {

using sonocase::testing::CommandResult;
using sonocase::testing::read_text;
using sonocase::testing::TemporaryFolder;

CommandResult sonocase_run(const std::string& arguments, const TemporaryFolder& folder) {
    return sonocase::testing::run_command("cd " + folder.path() + " && " SONOCASE_BIN "/sonocase " +
                                          arguments);
}

int lines(const std::string& text) {
    return static_cast<int>(std::count(text.begin(), text.end(), '\n'));
}

const char* const kTinyRecipe =
    "name = \"tiny\"\npreset = \"draft\"\nexercises = []\n[analytic]\nvoxel_mm = 8\nslice_mm = 8\n"
    "points = 600\nknown_map = true\n[resample]\nvoxel_mm = 6\n[texture]\nedge = 8\nspeckle_edge = "
    "8\n";

TEST(CommandLine, HelpListsVerbsAndVersionSaysHowItWasBuilt) {
    const TemporaryFolder folder;
    const CommandResult help = sonocase_run("--help", folder);
    EXPECT_EQ(help.status, 0);
    for (const char* verb : {"build", "import", "surface", "align", "warp", "resample", "smooth",
                             "texture", "pack", "register", "map", "inspect", "validate", "export"})
        EXPECT_NE(help.out.find(std::string("\n  ") + verb), std::string::npos) << verb;
    EXPECT_EQ(help.error, "");
    const CommandResult version = sonocase_run("--version", folder);
    EXPECT_EQ(version.status, 0);
    EXPECT_TRUE(version.out.starts_with("sonocase ")) << version.out;
    for (const char* fact : {"\ncommit ", "\ncompiler ", "\nbuild ", "\nlibraries ", "ITK "})
        EXPECT_NE(version.out.find(fact), std::string::npos) << fact << "\n" << version.out;
}

TEST(CommandLine, WrongUsageIsStatusTwoWithTheNearestVerb) {
    const TemporaryFolder folder;
    EXPECT_EQ(sonocase_run("", folder).status, 2);
    const CommandResult typo = sonocase_run("bulid", folder);
    EXPECT_EQ(typo.status, 2);
    EXPECT_NE(typo.error.find("did you mean 'build'?"), std::string::npos) << typo.error;
    EXPECT_EQ(lines(typo.error), 1);
    const CommandResult option = sonocase_run("build --colour blue", folder);
    EXPECT_EQ(option.status, 2);
    EXPECT_EQ(lines(option.error), 1) << option.error;
    const CommandResult mistyped = sonocase_run("import --tabel names.csv", folder);
    EXPECT_NE(mistyped.error.find("--tabel is no option; did you mean --table?"), std::string::npos)
        << mistyped.error;
    EXPECT_EQ(sonocase_run("import a.nii", folder).status, 2);  // no -o
    EXPECT_EQ(sonocase_run("build --threads -3", folder).status, 2);
    EXPECT_TRUE(folder.names().empty());
}

TEST(CommandLine, ASettingTakesOneWordAndLeavesTheRecipe) {
    const TemporaryFolder folder;
    folder.write("case.toml", kTinyRecipe);
    for (const char* arguments :
         {"build --list-options --set resample.voxel_mm=5 case.toml",
          "plan -o farm --dry-run --set resample.voxel_mm=5 --set texture.edge=8 case.toml"}) {
        const CommandResult run = sonocase_run(arguments, folder);
        EXPECT_EQ(run.status, 0) << arguments << "\n" << run.error;
    }
    EXPECT_EQ(sonocase_run("build --set resample.voxel_mm=5 none.toml", folder).error.find("--set"),
              std::string::npos);
}

TEST(CommandLine, EveryVerbHasHelp) {
    const TemporaryFolder folder;
    for (const char* verb :
         {"build", "import", "surface", "align", "warp", "resample", "smooth", "texture", "pack",
          "register", "map", "inspect", "validate", "export"}) {
        const CommandResult help = sonocase_run(std::string(verb) + " --help", folder);
        EXPECT_EQ(help.status, 0) << verb;
        EXPECT_NE(help.out.find("Usage: sonocase"), std::string::npos) << verb << help.out;
    }
}

TEST(CommandLine, FailureIsStatusOneWithOneLineAndNothingWritten) {
    const TemporaryFolder folder;
    folder.write("bad.toml", "[inputs]\nlables = \"x\"\n");
    folder.write("gone.toml", "[inputs]\nlabels = \"no.nii.gz\"\nsurface = \"no.ply\"\n");
    folder.write("short.nii", std::string(200, 'x'));
    folder.write("few.csv", "x,y,z\n1,2,3\n");
    const auto before = folder.names();
    for (const auto& [arguments, part] :
         {std::pair<const char*, const char*>{"build bad.toml -o out.sonocase", "bad.toml:2"},
          {"build gone.toml -o out.sonocase", "no.nii.gz"},
          {"build missing.toml -o out.sonocase", "missing.toml"},
          {"import short.nii -o out.labels", "short.nii"},
          {"inspect few.csv", "few.csv"},
          {"validate few.csv", "few.csv"},
          {"export few.csv -o out", "few.csv"}}) {
        const CommandResult result = sonocase_run(arguments, folder);
        EXPECT_EQ(result.status, 1) << arguments << "\n" << result.error;
        EXPECT_EQ(lines(result.error), 1) << arguments << "\n" << result.error;
        EXPECT_NE(result.error.find(part), std::string::npos) << arguments << "\n" << result.error;
        EXPECT_EQ(folder.names(), before) << arguments;
    }
}

TEST(CommandLine, ATraineeWhoIsNotInTheBookIsNamed) {
    const TemporaryFolder folder;
    EXPECT_EQ(sonocase_run("progress --progress book.sqlite", folder).status, 0);
    for (const char* option : {"--trainee", "--remove"}) {
        const CommandResult result =
            sonocase_run(std::string("progress --progress book.sqlite ") + option + " Ada", folder);
        EXPECT_EQ(result.status, 1) << result.error;
        EXPECT_EQ(lines(result.error), 1) << result.error;
        EXPECT_NE(result.error.find("has no trainee 'Ada'"), std::string::npos) << result.error;
    }
}

// Reading a device may never end, and opening a pipe waits for its writer.
TEST(CommandLine, DevicesAndPipesAreRefusedAtOnce) {
    const TemporaryFolder folder;
    ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
    for (const auto& [arguments, part] :
         {std::pair<const char*, const char*>{"inspect /dev/zero", "/dev/zero: is a device"},
          {"inspect pipe", "pipe: is a pipe"},
          {"validate /dev/zero", "is a device"},
          {"build /dev/zero -o out.sonocase", "is a device"},
          {"import /dev/zero -o out.labels", "/dev/zero"},
          {"score pipe", "is a pipe"}}) {
        const CommandResult result = sonocase_run(arguments, folder);
        EXPECT_EQ(result.status, 1) << arguments << "\n" << result.error;
        EXPECT_EQ(lines(result.error), 1) << arguments << "\n" << result.error;
        EXPECT_NE(result.error.find(part), std::string::npos) << arguments << "\n" << result.error;
    }
}

// A needle that goes 5 mm straight into a box of 8 corners and out again.
TEST(CommandLine, ScoresARecordingOfAnotherTrainerAgainstItsTissueMesh) {
    const TemporaryFolder folder;
    folder.write("box.obj", sonocase::testing::kBoxObj);
    std::string log = "<TransformRecorderLog>\n";
    for (int n = 0; n <= 20; ++n) {
        const int tip_mm = 5 + std::abs(n - 10);  // 15 ... 5 ... 15; the box ends at 10
        log += "<log TimeStampSec=\"" + std::to_string(n) +
               "\" TimeStampNSec=\"0\" type=\"transform\" "
               "DeviceName=\"NeedleToReference\" transform=\"1 0 0 0 0 -1 0 0 0 0 -1 " +
               std::to_string(tip_mm) + " 0 0 0 1\" />\n";
    }
    folder.write("log.xml", log + "</TransformRecorderLog>\n");
    folder.write("exercise.toml", "name = \"box\"\n");
    const CommandResult result =
        sonocase_run("score log.xml --body box.obj --exercise exercise.toml --json", folder);
    ASSERT_EQ(result.status, 0) << result.error;
    const auto metrics = nlohmann::json::parse(result.out)["metrics"];
    EXPECT_EQ(metrics["insertions"], 1);
    EXPECT_NEAR(metrics["deepest_mm"].get<double>(), 5, 1e-9);
}

#ifndef __SANITIZE_ADDRESS__  // which takes memory of its own
// The farm and --memory-mb trust what is said before a build. Bytes, unlike seconds, do not depend
// on what else the machine does.
TEST(CommandLine, ABuildTakesTheMemoryThatWasSaid) {
    const TemporaryFolder folder;
    const std::string known = "known_map = true\nvoxel_mm = 1.5\nslice_mm = 1.5\n";
    std::map<std::string, std::string> recipes{
        {"neck",
         "[analytic]\nbody = \"neck\"\nneck_seed = 7\nvoxel_mm = 0.75\nslice_mm = 1\n"
         "known_map = true\n[resample]\nvoxel_mm = 1.5\n"},
        {"phantom",
         "[analytic]\nbody = \"flow-phantom\"\n" + known + "[resample]\nvoxel_mm = 1.5\n"}};
    if (std::filesystem::exists(SONOCASE_DATA "/ct/labels.nii.gz"))
        recipes["ct"] = "[inputs]\nlabels = \"" SONOCASE_DATA
                        "/ct/labels.nii.gz\"\nlabel_table = \"" SONOCASE_DATA
                        "/ct/labels.csv\"\nown_skin = true\n[resample]\nvoxel_mm = 2\n";
    for (const auto& [name, recipe] : recipes) {
        folder.write("case.toml", "name = \"" + name + "\"\nexercises = []\n" + recipe);
        const CommandResult build =
            sonocase_run("build case.toml -o out.sonocase --report r.json --threads 2", folder);
        ASSERT_EQ(build.status, 0) << build.error;
        const auto report = nlohmann::json::parse(read_text(folder / "r.json"));
        const double said = report["expected"]["memory_mb"], took = report["peak_mb"];
        EXPECT_NEAR(said / took, 1, 0.15)
            << name << ": " << said << " MB said, " << took << " taken";
    }
}
#endif

// What inspect says and draws of the accuracy of a case.
TEST(CommandLine, InspectDrawsTheAccuracyOfACase) {
    const TemporaryFolder folder;
    folder.write("case.toml", kTinyRecipe);
    ASSERT_EQ(sonocase_run("build case.toml -o tiny.sonocase", folder).status, 0);
    const CommandResult said =
        sonocase_run("inspect tiny.sonocase --accuracy --picture a.svg", folder);
    ASSERT_EQ(said.status, 0) << said.error;
    EXPECT_NE(said.out.find("where its millimetres come from"), std::string::npos) << said.out;
    EXPECT_NE(said.out.find("as it is"), std::string::npos) << said.out;
    EXPECT_NE(read_text(folder / "a.svg").find("<svg"), std::string::npos);
    EXPECT_EQ(sonocase_run("inspect tiny.sonocase --picture a.gif", folder).status, 1);
    EXPECT_EQ(sonocase_run("inspect tiny.sonocase --accuracy --json", folder).status, 2);
    // The page of check has the same picture.
    sonocase_run("check tiny.sonocase -o page.html", folder);
    EXPECT_NE(read_text(folder / "page.html").find("<h2>Accuracy</h2>"), std::string::npos);
}

TEST(CommandLine, BuildInspectValidateAndExportATinyCase) {
    const TemporaryFolder folder;
    folder.write("case.toml", kTinyRecipe);
    const CommandResult build =
        sonocase_run("build case.toml -o a/tiny.sonocase --report r.json --cache cache", folder);
    ASSERT_EQ(build.status, 0) << build.error;
    EXPECT_EQ(build.error.find('\r'), std::string::npos) << "no progress bar in a pipe";
    const auto report = nlohmann::json::parse(read_text(folder / "r.json"));
    EXPECT_TRUE(report.contains("stages"));
    EXPECT_GT(report["seconds"].get<double>(), 0);

    const CommandResult inspect = sonocase_run("inspect a/tiny.sonocase --json", folder);
    ASSERT_EQ(inspect.status, 0) << inspect.error;
    const auto json = nlohmann::json::parse(inspect.out);
    EXPECT_EQ(json["grid"]["voxel_mm"], 6);
    EXPECT_EQ(json["grid"]["size"].size(), 3u);
    bool liver = false;
    for (const auto& label : json["labels"]) {
        EXPECT_TRUE(label.contains("index") && label.contains("tissue"));
        liver = liver || (label["name"] == "liver" && label["volume_ml"].get<double>() > 1000);
    }
    EXPECT_TRUE(liver);
    std::vector<std::string> stages;
    for (const auto& stage : json["stages"]) {
        stages.push_back(stage["name"]);
        EXPECT_TRUE(stage["seconds"].is_number()) << stage.dump();
        EXPECT_TRUE(stage["errors"].is_object());
    }
    EXPECT_EQ(stages, (std::vector<std::string>{"import", "surface", "warp", "resample", "texture",
                                                "structure", "flow", "pack"}));

    // Moved away from its report the bundle says that the seconds are not recorded, and stays
    // valid.
    std::filesystem::rename(folder / "a/tiny.sonocase", folder / "moved.sonocase");
    const auto moved =
        nlohmann::json::parse(sonocase_run("inspect moved.sonocase --json", folder).out);
    EXPECT_TRUE(moved["stages"][0]["seconds"].is_null());
    EXPECT_EQ(sonocase_run("validate moved.sonocase", folder).status, 0);
    EXPECT_EQ(sonocase_run("inspect moved.sonocase", folder).status, 0);
    const CommandResult exported = sonocase_run("export moved.sonocase -o files", folder);
    ASSERT_EQ(exported.status, 0) << exported.error;
    EXPECT_TRUE(std::filesystem::exists(folder / "files/labels.seg.nrrd"));

    // A damaged bundle is not valid, in one line.
    std::string bytes = read_text(folder / "moved.sonocase");
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
    folder.write("bad.sonocase", bytes);
    const CommandResult damaged = sonocase_run("validate bad.sonocase", folder);
    EXPECT_EQ(damaged.status, 1);
    EXPECT_EQ(lines(damaged.error), 1) << damaged.error;
}

// Not only in the report: the person who asked reads it.
TEST(CommandLine, ATimeThatWasAskedForAndMissedIsSaidAfterTheBuild) {
    const TemporaryFolder folder;
    folder.write("case.toml", kTinyRecipe);
    const CommandResult build =
        sonocase_run("build case.toml -o a.sonocase --report r.json --time-budget-s 0.01", folder);
    ASSERT_EQ(build.status, 0) << build.error;
    EXPECT_NE(build.error.find("warning: asked for 0.01 s, took "), std::string::npos)
        << build.error;
    const auto report = nlohmann::json::parse(read_text(folder / "r.json"));
    EXPECT_TRUE(report["choice"].contains("missed"));
}

// The stages one by one, files in and files out, come to what build makes of the same inputs.
TEST(CommandLine, StagesAloneMakeTheCaseThatBuildMakes) {
    const TemporaryFolder folder;
    const auto ok = [&](const std::string& arguments) {
        const CommandResult result = sonocase_run(arguments, folder);
        EXPECT_EQ(result.status, 0) << arguments << "\n" << result.error;
        return result.status == 0;
    };
    folder.write("case.toml", kTinyRecipe);
    ASSERT_TRUE(ok("build case.toml -o source.sonocase"));
    ASSERT_TRUE(ok("export source.sonocase -o in"));
    folder.write("files.toml",
                 "preset = \"draft\"\n[inputs]\nlabels = \"in/labels.seg.nrrd\"\n"
                 "surface = \"in/mannequin.ply\"\n[resample]\nvoxel_mm = 6\n[texture]\nedge = 8\n"
                 "speckle_edge = 8\n");
    ASSERT_TRUE(ok("build files.toml -o whole.sonocase"));

    const std::string fit = " --labels ct.labels --surface in/mannequin.ply ";
    ASSERT_TRUE(ok("import in/labels.seg.nrrd -o ct.labels --report import.json"));
    ASSERT_TRUE(ok("surface --labels ct.labels -o skin.surface"));
    ASSERT_TRUE(ok("register" + fit + "-o reg.json"));
    ASSERT_TRUE(ok("resample ct.labels --registration reg.json --voxel-mm 6 -o cooked.labels"));
    ASSERT_TRUE(ok("texture --edge 8 --speckle-edge 8 -o bank.textures"));
    ASSERT_TRUE(
        ok("pack --labels cooked.labels --textures bank.textures --surface in/mannequin.ply "
           "--skin skin.surface --registration reg.json --name x -o parts.sonocase"));
    ASSERT_TRUE(ok("validate parts.sonocase whole.sonocase"));
    ASSERT_TRUE(ok("export parts.sonocase -o parts"));
    ASSERT_TRUE(ok("export whole.sonocase -o whole"));
    for (const char* name : {"labels.seg.nrrd", "boundary.nrrd", "echo-offset.nrrd"})
        EXPECT_EQ(read_text(folder / (std::string("parts/") + name)),
                  read_text(folder / (std::string("whole/") + name)))
            << name;
    // Structure may also be baked by its own verb, before packing.
    ASSERT_TRUE(ok("structure cooked.labels -o baked.labels"));
    ASSERT_TRUE(
        ok("pack --labels baked.labels --textures bank.textures --surface in/mannequin.ply "
           "--no-structure -o baked.sonocase"));
    ASSERT_TRUE(ok("export baked.sonocase -o baked"));
    EXPECT_EQ(read_text(folder / "baked/echo-offset.nrrd"),
              read_text(folder / "whole/echo-offset.nrrd"));
    // No seconds in the files between: made again they are the same.
    const std::string first = read_text(folder / "cooked.labels");
    ASSERT_TRUE(
        ok("resample ct.labels --registration reg.json --voxel-mm 6 -o cooked.labels"
           " --threads 1"));
    EXPECT_TRUE(first == read_text(folder / "cooked.labels"));
}

// A folder that does not exist is created, but not silently: it may be a typing error.
TEST(CommandLine, NewFolderOfAnOutputFileIsNamedBeforeTheWork) {
    const TemporaryFolder folder;
    folder.write("case.toml", kTinyRecipe);
    const CommandResult new_folder =
        sonocase_run("build case.toml --until import --cache c --report no/such/r.json", folder);
    EXPECT_EQ(new_folder.status, 0) << new_folder.error;
    EXPECT_NE(new_folder.error.find("note: folder no/such does not exist and will be created"),
              std::string::npos)
        << new_folder.error;
    EXPECT_TRUE(std::filesystem::exists(folder / "no/such/r.json"));
    const CommandResult old_folder =
        sonocase_run("build case.toml --until import --cache c --report no/such/r.json", folder);
    EXPECT_EQ(old_folder.error, "");
}

// The advice on slanted axes names the verbs that have the option, and the key of the others.
TEST(CommandLine, OptionsThatErrorsNameExist) {
    const TemporaryFolder folder;
    for (const char* verb : {"import", "make", "register"})
        EXPECT_NE(sonocase_run(std::string(verb) + " --help", folder).out.find("--resample-shear"),
                  std::string::npos)
            << verb;
    folder.write("case.toml",
                 "name = \"x\"\n[inputs]\nlabels = \"no.nii\"\nown_skin = true\n"
                 "resample_shear = true\n");
    const std::string error =
        sonocase_run("build case.toml --until import --cache c", folder).error;
    EXPECT_NE(error.find("no.nii"), std::string::npos) << error;  // the file, and not the key
}

// Every option of a stage is a flag of its verb; a switch takes true or false as in a recipe.
TEST(CommandLine, OptionsOfAStageAreFlagsOfItsVerb) {
    const TemporaryFolder folder;
    const std::string resample = sonocase_run("resample --help", folder).out;
    for (const char* flag : {"--voxel-mm", "--follow-shift", "--snap-vx", "--closest-point"})
        EXPECT_NE(resample.find(flag), std::string::npos) << flag;
    const std::string fit = sonocase_run("register --help", folder).out;
    for (const char* flag : {"--starts", "--trials", "--paper", "--no-residual", "--spacing-mm"})
        EXPECT_NE(fit.find(flag), std::string::npos) << flag;
    for (const char* given : {"--closest-point false", "--no-closest-point", "--closest-point",
                              "--passes 2 --iterations 3"}) {
        const CommandResult result =
            sonocase_run(std::string("smooth no.labels -o x.labels ") + given, folder);
        EXPECT_EQ(result.status, 1) << given << result.error;  // the file, not the flags
        EXPECT_NE(result.error.find("no.labels"), std::string::npos) << result.error;
    }
    EXPECT_EQ(sonocase_run("smooth no.labels -o x.labels --passes 21", folder).status, 2);
}

}  // namespace
