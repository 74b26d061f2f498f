// SPDX-License-Identifier: Apache-2.0

// sonocase key: makes an author's key. sonocase sign: signs a case with it.
#include <sys/stat.h>

#include <cstdio>
#include <filesystem>

#include <CLI/CLI.hpp>

#include "formats/bundle/case_bundle.h"
#include "formats/files/atomic_file.h"
#include "formats/files/thread_jobs.h"
#include "pipeline/export/author_key.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

int verb_key(int argc, char** argv) {
    CLI::App app(
        "Make an author's key: FILE, which signs cases and stays with the author, and FILE.pub to "
        "give away. See docs/trust.md");
    std::string name, path;
    app.add_option("NAME", name, "The author, as players show it beside a signed case")->required();
    app.add_option("-o,--output", path, "Where to write the key")->type_name("FILE")->required();
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    std::error_code none;
    for (const std::string& file : {path, path + ".pub"})
        if (std::filesystem::exists(file, none))
            return fail("key", {"exists already", file,
                                "another FILE: who loses a key can no longer sign with it"});
    const AuthorKey key = new_author_key(name);
    const PublicKey open = public_key_of(key.key);
    if (!can_sign_as(name))
        return fail("key", {"'" + name + "' cannot be an author's name", "NAME",
                            "1 to 128 bytes of text in one line"});
    const mode_t before = umask(0077);  // for its owner's eyes alone
    const Status written = write_file(path, private_key_text(key));
    umask(before);
    if (!written) return fail("key", written.error());
    if (const auto status = write_file(path + ".pub", public_key_text(open, name)); !status)
        return fail("key", status.error());
    std::printf("%s\n%s.pub\nfingerprint %s\n", path.c_str(), path.c_str(),
                fingerprint_of(open).c_str());
    return kDone;
}

int verb_sign(int argc, char** argv) {
    CLI::App app(
        "Sign a case: players and pages show the author's name and the key's fingerprint, and say "
        "so if the case was changed since. See docs/trust.md");
    std::string path, key_file, name, out;
    app.add_option("CASE", path, "The bundle, of which its file gets the signature")->required();
    app.add_option("--key", key_file, "The author's key, of `sonocase key`")
        ->type_name("FILE")
        ->required();
    app.add_option("--name", name, "The author's name; default: that in the key's file")
        ->type_name("NAME");
    app.add_option("-o,--output", out, "Another file for the signed case; CASE stays as it is")
        ->type_name("FILE");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const auto text = read_text_file(key_file);
    if (!text) return fail("sign", text.error());
    const auto key = parse_author_key(*text, key_file);
    if (!key) return fail("sign", key.error());
    if (name.empty()) name = key->name;
    if (name.empty()) return fail("sign", {"the key says no name", key_file, "give --name NAME"});
    const auto bytes = read_file(path);
    if (!bytes) return fail("sign", bytes.error());
    ThreadJobs jobs;
    // Nobody signs what no player opens.
    if (const auto bundle = read_bundle(*bytes, path, jobs); !bundle)
        return fail("sign", bundle.error());
    const auto made = signed_case(*bytes, key->key, name, path, jobs);
    if (!made) return fail("sign", made.error());
    if (out.empty()) out = path;
    if (const auto status = write_file(out, *made); !status) return fail("sign", status.error());
    std::printf("%s: %s\n", out.c_str(), signature_words(signature_of(*made)).c_str());
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
