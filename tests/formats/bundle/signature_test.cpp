// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/signature.h"

#include <gtest/gtest.h>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/codec/chunk_file.h"
#include "support/tiny_case.h"

namespace sonocase {
namespace {

using Bytes = std::vector<std::uint8_t>;

SigningKey key_of(std::uint8_t n) {
    SigningKey key{};
    key.seed.fill(n);
    return key;
}

Bytes signed_tiny(const SigningKey& key, const CaseBundle& bundle = testing::curved_case()) {
    auto out = signed_case(write_bundle(bundle), key, "Dr. Änne Weber", "tiny");
    EXPECT_TRUE(out) << out.error().message();
    return out ? *out : Bytes();
}

// Test 1 of RFC 8032, 7.1: another program finds the same key.
TEST(Signature, KeysAreThoseOfTheStandard) {
    const SigningKey key{{0x9d, 0x61, 0xb1, 0x9d, 0xef, 0xfd, 0x5a, 0x60, 0xba, 0x84, 0x4a,
                          0xf4, 0x92, 0xec, 0x2c, 0xc4, 0x44, 0x49, 0xc5, 0x69, 0x7b, 0x32,
                          0x69, 0x19, 0x70, 0x3b, 0xac, 0x03, 0x1c, 0xae, 0x7f, 0x60}};
    const PublicKey expected{{0xd7, 0x5a, 0x98, 0x01, 0x82, 0xb1, 0x0a, 0xb7, 0xd5, 0x4b, 0xfe,
                              0xd3, 0xc9, 0x64, 0x07, 0x3a, 0x0e, 0xe1, 0x72, 0xf3, 0xda, 0xa6,
                              0x23, 0x25, 0xaf, 0x02, 0x1a, 0x68, 0xf7, 0x07, 0x51, 0x1a}};
    EXPECT_EQ(public_key_of(key), expected);
    EXPECT_EQ(fingerprint_of(expected).size(), 39u);
    EXPECT_NE(fingerprint_of(expected), fingerprint_of(public_key_of(key_of(1))));
}

TEST(Signature, ACaseWithoutOneHasNone) {
    EXPECT_EQ(signature_of(write_bundle(testing::tiny_case())).fit, SignatureFit::none);
    EXPECT_EQ(signature_of({}).fit, SignatureFit::none);
}

TEST(Signature, FitsTheCaseAndLeavesItAsItWas) {
    const Bytes bytes = signed_tiny(key_of(7));
    const CaseSignature found = signature_of(bytes);
    EXPECT_EQ(found.fit, SignatureFit::fits);
    EXPECT_EQ(found.name, "Dr. Änne Weber");
    EXPECT_EQ(found.key, public_key_of(key_of(7)));
    const auto read = read_bundle(bytes, "signed");
    ASSERT_TRUE(read) << read.error().message();
    EXPECT_EQ(write_bundle(*read), write_bundle(testing::curved_case()));
    EXPECT_EQ(signed_tiny(key_of(7)), bytes) << "the same key signs with the same bytes";
}

TEST(Signature, StaysWithAPublishedCase) {
    for (const bool textures : {false, true}) {
        const auto sent = arranged_for_loading(signed_tiny(key_of(7)), textures, "signed");
        ASSERT_TRUE(sent);
        EXPECT_EQ(signature_of(*sent).fit, SignatureFit::fits);
        EXPECT_TRUE(parts_to_open(*sent, "signed"));
    }
}

TEST(Signature, ASecondOneTakesThePlaceOfTheFirst) {
    const auto again = signed_case(signed_tiny(key_of(7)), key_of(8), "Another", "signed");
    ASSERT_TRUE(again);
    const CaseSignature found = signature_of(*again);
    EXPECT_EQ(found.fit, SignatureFit::fits);
    EXPECT_EQ(found.key, public_key_of(key_of(8)));
    EXPECT_EQ(found.name, "Another");
}

TEST(Signature, ACaseThatWasChangedAndPackedAgainDoesNotFit) {
    const Bytes whole = signed_tiny(key_of(7));
    const std::vector<std::string> types = chunk_types(whole);
    const std::vector<std::string_view> known(types.begin(), types.end());
    const auto reader = ChunkReader::open(whole, "CASE", known, "signed");
    ASSERT_TRUE(reader);
    // Each chunk with another last byte, or left out, or longer, checksums in order.
    for (const std::string& changed : types) {
        for (const int how : {0, 1, 2}) {
            ChunkWriter writer("CASE");
            for (const std::string& type : types) {
                Bytes raw = *reader->read(type, reader->raw_bytes(type));
                if (type == changed) {
                    if (how == 1 || raw.empty()) continue;
                    if (how == 0) raw.back() ^= 1;
                    if (how == 2) raw.push_back(65);
                }
                writer.add(type, reader->is_required(type), std::move(raw));
            }
            const CaseSignature found = signature_of(writer.write());
            EXPECT_EQ(found.fit,
                      changed == "signed" && how == 1 ? SignatureFit::none : SignatureFit::differs)
                << changed << " " << how;
        }
    }
    ChunkWriter more("CASE");
    for (const std::string& type : types)
        more.add(type, reader->is_required(type), *reader->read(type, reader->raw_bytes(type)));
    EXPECT_EQ(signature_of(more.write()).fit, SignatureFit::fits) << "packed anew, nothing changed";
    more.add("flow", false, {1, 2, 3});
    EXPECT_EQ(signature_of(more.write()).fit, SignatureFit::differs) << "a chunk was added";
}

TEST(Signature, OfAnotherCaseOrKeyOrNameDoesNotFit) {
    const Bytes mine = signed_tiny(key_of(7));
    CaseBundle bundle = testing::curved_case();
    bundle.manifest.case_name = "another";
    const Bytes other = signed_tiny(key_of(7), bundle);
    const auto chunks = [](const Bytes& from) {
        const std::vector<std::string> types = chunk_types(from);
        const std::vector<std::string_view> known(types.begin(), types.end());
        return *ChunkReader::open(from, "CASE", known, "signed");
    };
    const auto with = [&](const Bytes& signature) {
        ChunkWriter writer("CASE");
        const ChunkReader reader = chunks(mine);
        for (const std::string& type : chunk_types(mine))
            writer.add(type, reader.is_required(type),
                       type == "signed" ? signature : *reader.read(type, reader.raw_bytes(type)));
        return signature_of(writer.write()).fit;
    };
    const Bytes own = *chunks(mine).read("signed", 1024);
    EXPECT_EQ(with(own), SignatureFit::fits);
    EXPECT_EQ(with(*chunks(other).read("signed", 1024)), SignatureFit::differs);
    Bytes key = own;
    const PublicKey stranger = public_key_of(key_of(9));
    std::copy(stranger.begin(), stranger.end(), key.begin() + 4);
    EXPECT_EQ(with(key), SignatureFit::differs);
    for (std::size_t at = 4; at < own.size(); ++at) {
        Bytes bit = own;
        bit[at] ^= 0x01;
        EXPECT_NE(with(bit), SignatureFit::fits) << at;
    }
    // A key of small order would let one signature fit every case.
    Bytes weak = own;
    std::fill_n(weak.begin() + 4, 96, std::uint8_t{0});
    weak[4] = weak[36] = 1;
    EXPECT_EQ(with(weak), SignatureFit::differs);
    for (const std::size_t size :
         {std::size_t{0}, std::size_t{3}, std::size_t{99}, std::size_t{100}})
        EXPECT_EQ(with(Bytes(own.begin(), own.begin() + static_cast<std::ptrdiff_t>(size))),
                  SignatureFit::unreadable);
    Bytes newer = own;
    newer[0] = 2;
    EXPECT_EQ(with(newer), SignatureFit::unreadable);
    Bytes longer = own;
    longer.resize(100 + 129, 'a');
    EXPECT_EQ(with(longer), SignatureFit::unreadable);
}

// What no checksum of the container mends is refused before anything is read of it; a signature
// never fits.
TEST(Signature, AnyChangedByteAndAnyCutIsNoticed) {
    const Bytes whole = signed_tiny(key_of(7), testing::tiny_case());
    for (std::size_t at = 0; at < whole.size(); ++at) {
        Bytes bad = whole;
        bad[at] ^= 0x10;
        EXPECT_NE(signature_of(bad).fit, SignatureFit::fits) << at;
    }
    for (std::size_t size = 0; size < whole.size(); size += 7)
        EXPECT_NE(signature_of(std::span(whole).first(size)).fit, SignatureFit::fits) << size;
}

TEST(Signature, ANameIsTextThatCanBeShown) {
    const Bytes bytes = write_bundle(testing::tiny_case());
    for (const char* name : {"A", "Änne", "学校", "O'Neil & <Sons>"})
        EXPECT_TRUE(signed_case(bytes, key_of(1), name, "tiny")) << name;
    for (const std::string& name :
         {std::string(), std::string(129, 'a'), std::string("a\nb"), std::string("a\x1b[31m"),
          std::string("\xC3"), std::string("\xC0\x80"), std::string("\xED\xA0\x80"),
          std::string("a\xE2\x80\xAE"
                      "b"),
          std::string("a\xC2\x9B"), std::string("\xF5\x80\x80\x80"), std::string("a\0b", 3)})
        EXPECT_FALSE(signed_case(bytes, key_of(1), name, "tiny")) << name;
    EXPECT_FALSE(signed_case(Bytes{1, 2, 3}, key_of(1), "A", "no case"));
}

}  // namespace
}  // namespace sonocase
