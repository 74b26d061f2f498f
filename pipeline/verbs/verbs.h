// The verbs of the program sonocase. Each is a thin call to one stage or subject.
//
// argv[0] is the verb's own name. Returns the exit status: 0 done, 1 failed with one line on standard
// error, 2 wrong usage. To add one: write verb_<name>.cpp, declare it here, list the file in
// CMakeLists.txt and the verb in the table in main.cpp. The shape of all of them:
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
// Files between the stages: label volumes are .seg.nrrd (any label map is read), surfaces PLY,
// registrations JSON; boundary records, echo offsets and textures travel in a part bundle: a
// *.sonocase of which only the fields that the stage made are filled. pack merges the parts.
#pragma once

namespace sonocase::pipeline {

}  // namespace sonocase::pipeline
