// SPDX-License-Identifier: Apache-2.0

// The hand-written verbs of the program sonocase. Each is a thin call to one subject. A verb that
// only runs a stage, files in and files out, comes from the stage's descriptor instead
// (pipeline/verbs/stage_verb.h); the file of a stage's hand-written verb says what more it does.
//
// argv[0] is the verb's own name. Returns the exit status: 0 done, 1 failed with one line on
// standard error, 2 wrong usage. To add one: write verb_<name>.cpp, declare it here, list the file
// in CMakeLists.txt and the verb in the table in main.cpp. The shape of all of them:
//
//     int verb_align(int argc, char** argv) {
//         CLI::App app("Find the rigid motion that lays the skin on the mannequin");
//         CommonOptions common;
//         std::string out;
//         app.add_option("-o,--output", out, "Where to write")->type_name("REG.json")->required();
//         add_common_options(app, common);
//         if (const auto status = parse_command_line(app, argc, argv)) return *status;
//         const ThreadLimit limit(common.threads);
//         ProgressBar bar(common);
//         auto result = align(..., bar.progress());
//         if (!result) return fail("align", result.error());
//         print_warnings("align", result->report);
//         if (auto s = save_registration(...); !s) return fail("align", s.error());
//         if (auto s = write_report(common, result->report); !s) return fail("align", s.error());
//         return kDone;
//     }
//
// Files between the stages are those of formats/bundle/stage_files.h (.labels, .textures, .surface)
// and pipeline/registration/map/registration.h (JSON). A stage file holds no seconds, so that the
// same inputs give the same bytes; seconds go to --report.
#pragma once

namespace sonocase::pipeline::inline verbs {

int verb_aim(int argc, char** argv);
int verb_align(int argc, char** argv);
int verb_build(int argc, char** argv);
int verb_cache(int argc, char** argv);
int verb_calibrate(int argc, char** argv);
int verb_check(int argc, char** argv);
int verb_export(int argc, char** argv);
int verb_inspect(int argc, char** argv);
int verb_key(int argc, char** argv);
int verb_landmarks(int argc, char** argv);
int verb_look(int argc, char** argv);
int verb_make(int argc, char** argv);
int verb_map(int argc, char** argv);
int verb_markers(int argc, char** argv);
int verb_pack(int argc, char** argv);
int verb_plan(int argc, char** argv);
int verb_progress(int argc, char** argv);
int verb_publish(int argc, char** argv);
int verb_register(int argc, char** argv);
int verb_review(int argc, char** argv);
int verb_score(int argc, char** argv);
int verb_sign(int argc, char** argv);
int verb_texture(int argc, char** argv);
int verb_tradeoff(int argc, char** argv);
int verb_validate(int argc, char** argv);
int verb_warp(int argc, char** argv);

}  // namespace sonocase::pipeline::inline verbs
