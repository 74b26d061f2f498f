// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/author_key.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/codec/chunk_file.h"
#include "formats/files/atomic_file.h"
#include "support/temporary_folder.h"
#include "support/tiny_case.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::TemporaryFolder;

struct Answer {
    int status = 0;
    std::string text;
};
Answer openssl(const std::string& arguments) {
    Answer answer;
    std::FILE* pipe = popen(("openssl " + arguments + " 2>&1").c_str(), "r");
    char part[4096];
    while (const std::size_t n = std::fread(part, 1, sizeof part, pipe))
        answer.text.append(part, n);
    answer.status = pclose(pipe);
    return answer;
}
bool has_openssl() {
    return openssl("version").status == 0;
}

TEST(AuthorKey, FilesReadBackAsTheyWere) {
    const AuthorKey key = new_author_key("Dr. Anna Weber");
    EXPECT_NE(key.key.seed, new_author_key("Dr. Anna Weber").key.seed);
    const auto read = parse_author_key(private_key_text(key), "key");
    ASSERT_TRUE(read) << read.error().message();
    EXPECT_EQ(read->key.seed, key.key.seed);
    EXPECT_EQ(read->name, key.name);
    const PublicKey open = public_key_of(key.key);
    for (const std::string& text : {public_key_text(open, key.name), private_key_text(key)}) {
        const auto found = parse_public_key(text, "key");
        ASSERT_TRUE(found) << found.error().message();
        EXPECT_EQ(*found, open);
    }
    EXPECT_EQ(parse_author_key(private_key_text({key.key, ""}), "key")->name, "");
}

TEST(AuthorKey, TextThatIsNoneIsRefusedInOneSentence) {
    const std::string good = private_key_text(new_author_key("A"));
    const auto sentence = [](const std::string& text) {
        const auto read = parse_author_key(text, "key.pem");
        EXPECT_FALSE(read) << text;
        return read ? std::string() : read.error().message();
    };
    EXPECT_NE(sentence(public_key_text({}, "A")).find("public key"), std::string::npos);
    EXPECT_NE(sentence("-----BEGIN ENCRYPTED PRIVATE KEY-----\n").find("encrypted"),
              std::string::npos);
    const std::size_t inside = good.find("KEY-----\n") + 9;
    for (std::size_t size = 0; size < good.size() - 2; ++size) sentence(good.substr(0, size));
    for (std::size_t at = inside; at < inside + 20; ++at) {  // what says that it is such a key
        std::string bad = good;
        bad[at] = bad[at] == 'A' ? 'B' : 'A';
        sentence(bad);
    }
    std::string longer = good;
    longer.insert(inside, std::string(4000, 'A'));
    sentence(longer);
    longer = good;
    longer.insert(inside, 1, '\0');
    sentence(longer);
}

// Two programs: keys that OpenSSL made are read, and it reads ours; the statement of
// docs/format.md, part 10, written down here once more, has the signature that it says.
TEST(AuthorKey, OpenSslAgrees) {
    if (!has_openssl()) GTEST_SKIP() << "no openssl";
    TemporaryFolder folder;
    const std::string theirs = folder / "theirs.pem", ours = folder / "ours.pem";
    ASSERT_EQ(openssl("genpkey -algorithm ed25519 -out " + theirs).status, 0);
    ASSERT_EQ(openssl("pkey -in " + theirs + " -pubout -out " + theirs + ".pub").status, 0);
    const auto key = parse_author_key(*read_text_file(folder / "theirs.pem"), theirs);
    ASSERT_TRUE(key) << key.error().message();
    EXPECT_EQ(*parse_public_key(*read_text_file(folder / "theirs.pem.pub"), theirs),
              public_key_of(key->key));
    const AuthorKey own = new_author_key("Anna");
    folder.write("ours.pem", private_key_text(own));
    const Answer open = openssl("pkey -in " + ours + " -pubout");
    EXPECT_EQ(open.text, public_key_text(public_key_of(own.key), ""));

    const auto made =
        signed_case(write_bundle(sonocase::testing::curved_case()), key->key, "Anna", "curved");
    ASSERT_TRUE(made);
    std::vector<std::string> types = chunk_types(*made);
    const std::vector<std::string_view> known(types.begin(), types.end());
    const auto reader = ChunkReader::open(*made, "CASE", known, "curved");
    ASSERT_TRUE(reader);
    std::sort(types.begin(), types.end());
    std::string statement = "sonocase case signature 1\nname Anna\n";
    const auto text_of = [](const std::vector<std::uint8_t>& bytes) {
        return std::string(bytes.begin(), bytes.end());
    };
    for (const std::string& type : types) {
        if (type == "signed") continue;
        const auto raw = *reader->read(type, reader->raw_bytes(type));
        folder.write("chunk", text_of(raw));
        const std::string hash = openssl("dgst -sha512 -r " + (folder / "chunk")).text;
        statement += "chunk " + type + (reader->is_required(type) ? " required " : " optional ") +
                     std::to_string(raw.size()) + " " + hash.substr(0, hash.find(' ')) + "\n";
    }
    const std::string chunk = text_of(*reader->read("signed", 1024));
    folder.write("statement", statement);
    folder.write("signature", chunk.substr(36, 64));
    const std::string verify = "pkeyutl -verify -rawin -pubin -inkey " + theirs + ".pub -in " +
                               (folder / "statement") + " -sigfile " + (folder / "signature");
    EXPECT_EQ(openssl(verify).status, 0) << openssl(verify).text;
    folder.write("statement", statement + " ");
    EXPECT_NE(openssl(verify).status, 0);
}

}  // namespace
}  // namespace sonocase::pipeline
