// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/course_package.h"

#include <zlib.h>

#include <algorithm>
#include <cassert>
#include <limits>
#include <utility>

namespace sonocase::pipeline::inline exporting {
namespace {

std::string xml_text(const std::string& text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '&': out += "&amp;"; break;
            case '<': out += "&lt;"; break;
            case '>': out += "&gt;"; break;
            case '"': out += "&quot;"; break;
            default:
                // XML 1.0 has no other control characters.
                out += static_cast<unsigned char>(c) < ' ' && c != '\n' && c != '\t' ? ' ' : c;
        }
    }
    return out;
}

std::string element(const std::string& name, const std::string& text) {
    return "<" + name + ">" + xml_text(text) + "</" + name + ">";
}

// An identifier for xAPI and for global objectives, the same wherever the package is opened.
std::string course_id(const Course& course) {
    return "urn:sonocase:course:" + plain_identifier(course.name);
}
std::string module_id(const Course& course, const CourseModule& module) {
    return course_id(course) + ":" + plain_identifier(module.name);
}
std::string module_query(const CourseModule& module) {
    return "?module=" + plain_identifier(module.name);
}

// In all languages that the course has; its own words are taken for English.
std::string words_in_languages(const Course& course,
                               const std::string& own,
                               std::string Course::Texts::*of_course,
                               std::string Course::Texts::Module::*of_module,
                               std::size_t module) {
    std::string out = "<langstring lang=\"en\">" + xml_text(own) + "</langstring>";
    for (const Course::Texts& texts : course.texts) {
        const std::string& words = of_course ? texts.*of_course : texts.modules[module].*of_module;
        if (!words.empty() && texts.language != "en")
            out += "<langstring lang=\"" + xml_text(texts.language) + "\">" + xml_text(words) +
                   "</langstring>";
    }
    return out;
}

std::string cmi5_structure(const Course& course) {
    using Texts = Course::Texts;
    std::string out =
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
        "<courseStructure xmlns=\"https://w3id.org/xapi/profiles/cmi5/v1/CourseStructure.xsd\">\n"
        "  <course id=\"" +
        course_id(course) + "\">\n    <title>" +
        words_in_languages(course, course.title, &Texts::title, nullptr, 0) +
        "</title>\n    <description>" +
        words_in_languages(course, course.text.empty() ? course.title : course.text, &Texts::text,
                           nullptr, 0) +
        "</description>\n  </course>\n";
    for (std::size_t i = 0; i < course.modules.size(); ++i) {
        const CourseModule& module = course.modules[i];
        out += "  <au id=\"" + module_id(course, module) +
               "\" moveOn=\"Passed\" masteryScore=\"1.0\" launchMethod=\"AnyWindow\" "
               "activityType=\"http://adlnet.gov/expapi/activities/simulation\">\n    <title>" +
               words_in_languages(course, module.title, nullptr, &Texts::Module::title, i) +
               "</title>\n    <description>" +
               words_in_languages(course, module.text, nullptr, &Texts::Module::text, i) +
               "</description>\n    <url>index.html" + module_query(module) + "</url>\n  </au>\n";
    }
    return out + "</courseStructure>\n";
}

// What SCORM 2004 is told of a module's place: its own gate, and the gate before it.
std::string sequencing_of(const Course& course, std::size_t i) {
    const auto objective = [&](std::size_t module) {
        return module_id(course, course.modules[module]);
    };
    std::string out = "        <imsss:sequencing>\n";
    if (i > 0) {
        // Without the second condition an unknown status would open the module.
        out +=
            "          <imsss:sequencingRules><imsss:preConditionRule>\n"
            "            <imsss:ruleConditions conditionCombination=\"any\">\n"
            "              <imsss:ruleCondition referencedObjective=\"before\" operator=\"not\" "
            "condition=\"satisfied\"/>\n"
            "              <imsss:ruleCondition referencedObjective=\"before\" operator=\"not\" "
            "condition=\"objectiveStatusKnown\"/>\n"
            "            </imsss:ruleConditions>\n"
            "            <imsss:ruleAction action=\"disabled\"/>\n"
            "          </imsss:preConditionRule></imsss:sequencingRules>\n";
    }
    out +=
        "          <imsss:objectives>\n"
        "            <imsss:primaryObjective objectiveID=\"gate\" satisfiedByMeasure=\"true\">\n"
        "              <imsss:minNormalizedMeasure>1.0</imsss:minNormalizedMeasure>\n"
        "              <imsss:mapInfo targetObjectiveID=\"" +
        objective(i) +
        "\" readSatisfiedStatus=\"true\" readNormalizedMeasure=\"true\" "
        "writeSatisfiedStatus=\"true\" writeNormalizedMeasure=\"true\"/>\n"
        "            </imsss:primaryObjective>\n";
    if (i > 0) {
        out +=
            "            <imsss:objective objectiveID=\"before\">\n"
            "              <imsss:mapInfo targetObjectiveID=\"" +
            objective(i - 1) +
            "\" readSatisfiedStatus=\"true\" readNormalizedMeasure=\"false\" "
            "writeSatisfiedStatus=\"false\" writeNormalizedMeasure=\"false\"/>\n"
            "            </imsss:objective>\n";
    }
    return out +
           "          </imsss:objectives>\n"
           "          <imsss:deliveryControls completionSetByContent=\"true\" "
           "objectiveSetByContent=\"true\"/>\n"
           "        </imsss:sequencing>\n";
}

constexpr const char* kHead12 =
    "xmlns=\"http://www.imsproject.org/xsd/imscp_rootv1p1p2\"\n"
    "  xmlns:adlcp=\"http://www.adlnet.org/xsd/adlcp_rootv1p2\"";
constexpr const char* kHead2004 =
    "xmlns=\"http://www.imsglobal.org/xsd/imscp_v1p1\"\n"
    "  xmlns:adlcp=\"http://www.adlnet.org/xsd/adlcp_v1p3\"\n"
    "  xmlns:adlseq=\"http://www.adlnet.org/xsd/adlseq_v1p3\"\n"
    "  xmlns:imsss=\"http://www.imsglobal.org/xsd/imsss\"";

// One content object for each module: the same page, opened with the module's name.
std::string scorm_manifest(const Course& course, std::span<const SiteFile> files, bool is_2004) {
    std::string out = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<manifest identifier=\"course-" +
                      plain_identifier(course.name) + "\" version=\"1\"\n  " +
                      (is_2004 ? kHead2004 : kHead12) +
                      ">\n  <metadata><schema>ADL SCORM</schema><schemaversion>" +
                      (is_2004 ? "2004 4th Edition" : "1.2") +
                      "</schemaversion></metadata>\n"
                      "  <organizations default=\"modules\">\n    <organization "
                      "identifier=\"modules\"" +
                      (is_2004 ? " adlseq:objectivesGlobalToSystem=\"false\"" : "") + ">\n      " +
                      element("title", course.title) + "\n";
    for (std::size_t i = 0; i < course.modules.size(); ++i) {
        const CourseModule& module = course.modules[i];
        const std::string name = plain_identifier(module.name);
        out += "      <item identifier=\"item-" + name + "\" identifierref=\"module-" + name +
               "\" isvisible=\"true\" parameters=\"" + module_query(module) + "\">\n        " +
               element("title", module.title) + "\n";
        if (is_2004) {
            out += sequencing_of(course, i);
        } else {
            if (i > 0)
                out += "        <adlcp:prerequisites type=\"aicc_script\">item-" +
                       plain_identifier(course.modules[i - 1].name) + "</adlcp:prerequisites>\n";
            out += "        <adlcp:masteryscore>100</adlcp:masteryscore>\n";
        }
        out += "      </item>\n";
    }
    if (is_2004)
        out +=
            "      <imsss:sequencing><imsss:controlMode choice=\"true\" flow=\"true\"/>"
            "</imsss:sequencing>\n";
    out += "    </organization>\n  </organizations>\n  <resources>\n";
    const std::string type = is_2004 ? "adlcp:scormType" : "adlcp:scormtype";
    for (const CourseModule& module : course.modules)
        out += "    <resource identifier=\"module-" + plain_identifier(module.name) +
               "\" type=\"webcontent\" " + type +
               "=\"sco\" href=\"index.html\">\n      <file href=\"index.html\"/>"
               "<dependency identifierref=\"files\"/>\n    </resource>\n";
    out += "    <resource identifier=\"files\" type=\"webcontent\" " + type + "=\"asset\">\n";
    for (const SiteFile& file : files)
        if (file.name != "index.html")
            out += "      <file href=\"" + xml_text(file.name) + "\"/>\n";
    return out + "    </resource>\n  </resources>\n</manifest>\n";
}

class ByteWriter {
  public:
    void put(std::uint32_t value, int count) {
        for (int n = 0; n < count; ++n) data.push_back(static_cast<std::uint8_t>(value >> 8 * n));
    }
    void put(std::span<const std::uint8_t> bytes) {
        data.insert(data.end(), bytes.begin(), bytes.end());
    }
    void put(const std::string& text) { data.insert(data.end(), text.begin(), text.end()); }
    std::vector<std::uint8_t> data;
};

// Raw deflate, as zip wants it.
std::vector<std::uint8_t> deflated(std::span<const std::uint8_t> bytes) {
    z_stream stream{};
    const int begun =
        deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
    if (begun != Z_OK) return {bytes.begin(), bytes.end()};
    std::vector<std::uint8_t> out(deflateBound(&stream, static_cast<uLong>(bytes.size())));
    stream.next_in = const_cast<Bytef*>(bytes.data());
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = out.data();
    stream.avail_out = static_cast<uInt>(out.size());
    const int done = deflate(&stream, Z_FINISH);
    assert(done == Z_STREAM_END);
    (void)done;
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

}  // namespace

const std::vector<std::string>& package_names() {
    static const std::vector<std::string> names{"cmi5", "scorm12", "scorm2004"};
    return names;
}

std::string plain_identifier(const std::string& text) {
    std::string out;
    for (const char c : text) {
        const bool plain =
            (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
        out += plain ? c : '-';
    }
    return out.empty() ? "-" : out;
}

SiteFile package_manifest(const std::string& kind,
                          const Course& course,
                          std::span<const SiteFile> files) {
    const bool cmi5 = kind == "cmi5";
    const std::string text =
        cmi5 ? cmi5_structure(course) : scorm_manifest(course, files, kind == "scorm2004");
    return {cmi5 ? "cmi5.xml" : "imsmanifest.xml", {text.begin(), text.end()}};
}

Result<std::vector<std::uint8_t>> zip_of(std::span<const SiteFile> files) {
    constexpr std::uint32_t kLocal = 0x04034b50, kCentral = 0x02014b50, kEnd = 0x06054b50;
    constexpr std::uint32_t kFirstDay = 0x21;  // 1 January 1980, at midnight
    constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
    std::uint64_t total = 0;
    for (const SiteFile& file : files) total += file.bytes.size() + 2 * file.name.size() + 128;
    if (total >= kMost)
        return Error{"the package would have " + std::to_string(total >> 20) + " MB", "--package",
                     "at most 4 GB: give fewer cases, or cook them with --preset draft"};
    ByteWriter out, directory;
    for (const SiteFile& file : files) {
        const std::vector<std::uint8_t> packed = deflated(file.bytes);
        const bool smaller = packed.size() < file.bytes.size();
        const std::span<const std::uint8_t> data(smaller ? packed : file.bytes);
        const auto crc = static_cast<std::uint32_t>(
            crc32(crc32(0, nullptr, 0), file.bytes.data(), static_cast<uInt>(file.bytes.size())));
        const auto at = static_cast<std::uint32_t>(out.data.size());
        const auto facts = [&](ByteWriter& to) {
            to.put(20, 2);  // version needed: 2.0, deflate
            to.put(0, 2);
            to.put(smaller ? 8 : 0, 2);
            to.put(0, 2);
            to.put(kFirstDay, 2);
            to.put(crc, 4);
            to.put(static_cast<std::uint32_t>(data.size()), 4);
            to.put(static_cast<std::uint32_t>(file.bytes.size()), 4);
            to.put(static_cast<std::uint32_t>(file.name.size()), 2);
            to.put(0, 2);
        };
        out.put(kLocal, 4);
        facts(out);
        out.put(file.name);
        out.put(data);
        directory.put(kCentral, 4);
        directory.put(20, 2);
        facts(directory);
        directory.put(0, 2);  // comment
        directory.put(0, 2);  // disk
        directory.put(0, 2);
        directory.put(0, 4);
        directory.put(at, 4);
        directory.put(file.name);
    }
    const auto at = static_cast<std::uint32_t>(out.data.size());
    out.put(directory.data);
    out.put(kEnd, 4);
    out.put(0, 4);
    out.put(static_cast<std::uint32_t>(files.size()), 2);
    out.put(static_cast<std::uint32_t>(files.size()), 2);
    out.put(static_cast<std::uint32_t>(directory.data.size()), 4);
    out.put(at, 4);
    out.put(0, 2);
    return std::move(out.data);
}

}  // namespace sonocase::pipeline::inline exporting
