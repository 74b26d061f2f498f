// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/course.h"

#include <algorithm>

#include "formats/exercise/metric_table.h"
#include "formats/text/toml_reader.h"

namespace sonocase {
namespace {

// Lines of a text run on; an empty line begins a paragraph.
std::string running(const std::string& text) {
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] != '\n') {
            out += text[i];
            continue;
        }
        const bool paragraph = i + 1 < text.size() && text[i + 1] == '\n';
        out += paragraph ? '\n' : ' ';
        i += paragraph;
    }
    while (!out.empty() && (out.back() == ' ' || out.back() == '\n')) out.pop_back();
    return out.substr(std::min(out.find_first_not_of(" \n"), out.size()));
}

void need(const TomlTable& table, const char* key, std::string& to, const char* expected) {
    table.text(key, to);
    if (to.empty()) table.add_fault(key, "is missing or empty", expected);
}

void read_question(const TomlTable& table, CourseModule& m) {
    table.text("question", m.question);
    table.texts("options", m.options);
    table.text("because", m.because);
    m.because = running(m.because);
    const bool answered = table.whole("answer", m.answer, 0, 100);
    if (m.question.empty()) {
        for (const char* key : {"options", "answer", "because"})
            if (table.has(key))
                table.add_fault(key, "has no question", "expected question = \"...\"");
        return;
    }
    if (m.options.size() < 2 || m.options.size() > 4)
        table.add_fault("options", "has " + std::to_string(m.options.size()) + " texts",
                        "expected 2 to 4 to choose from");
    if (!answered)
        table.add_fault("answer", "is missing", "expected the index of the right option, from 0");
    else if (m.answer >= static_cast<int>(m.options.size()))
        table.add_fault("answer", "is no option",
                        "expected 0 to " + std::to_string(int(m.options.size()) - 1));
}

void read_practice(const TomlTable& table, CourseModule& m) {
    const std::vector<std::string> names = metric_names();
    if (const auto at = table.choice("measure", names)) m.measure = names[*at];
    if (!table.has("measure")) table.add_fault("measure", "is missing", "expected a score's name");
    const bool most = table.number("at_most", m.at_most, -1e9, 1e9);
    const bool least = table.number("at_least", m.at_least, -1e9, 1e9);
    if (!most && !least)
        table.add_fault("at_most", "is missing, and at_least too",
                        "expected a limit to practise to");
    if (m.at_least > m.at_most)
        table.add_fault("at_least", "lies above at_most",
                        "expected a range that has something in it");
    table.finish();
}

void read_gate(const TomlTable& table, CourseGate& gate) {
    table.whole("passes_in_a_row", gate.passes_in_a_row, 1, 100);
    table.flag("steady", gate.steady);
    table.flag("exam", gate.exam);
    if (gate.passes_in_a_row == 0 && !gate.steady)
        table.add_fault("passes_in_a_row", "is missing, and the gate is not by steady either",
                        "expected a rule by which the module is passed");
    table.finish();
}

CourseModule read_module(const TomlTable& table) {
    CourseModule m;
    need(table, "name", m.name, "expected a short name, as in \"in-plane\"");
    m.title = m.name;
    table.text("title", m.title);
    need(table, "text", m.text, "expected a few sentences");
    m.text = running(m.text);
    need(table, "case", m.case_name, "expected the name of a case, as in \"demo-torso\"");
    need(table, "exercise", m.exercise, "expected the name of one of the case's exercises");
    table.text("expert", m.expert);
    read_question(table, m);
    if (const auto practice = table.table("practice")) read_practice(*practice, m);
    if (const auto gate = table.table("gate"))
        read_gate(*gate, m.gate);
    else
        table.add_fault("gate", "is missing",
                        "expected gate = { passes_in_a_row = 2 } or the like");
    table.whole("retention_days", m.retention_days, 1, 3650);
    table.finish();
    return m;
}

void read_texts(const TomlTable& table, Course& course) {
    for (const std::string& language : table.keys()) {
        const auto own = table.table(language);
        if (!own) continue;
        if (language.size() != 2)
            table.add_fault(language, "is not a language code",
                            "expected two letters, as in [texts.de]");
        Course::Texts texts;
        texts.language = language;
        own->text("title", texts.title);
        own->text("text", texts.text);
        texts.text = running(texts.text);
        texts.modules.resize(course.modules.size());
        for (const TomlTable& part : own->tables("modules")) {
            std::vector<std::string> names;
            for (const CourseModule& m : course.modules) names.push_back(m.name);
            const auto at = part.choice("name", names);
            if (!part.has("name"))
                part.add_fault("name", "is missing", "expected the name of a module");
            Course::Texts::Module read;
            part.text("title", read.title);
            part.text("text", read.text);
            read.text = running(read.text);
            part.text("question", read.question);
            part.text("because", read.because);
            read.because = running(read.because);
            part.texts("options", read.options);
            part.finish();
            if (!at) continue;
            const std::size_t wanted = course.modules[*at].options.size();
            if (!read.options.empty() && read.options.size() != wanted)
                part.add_fault("options", "has " + std::to_string(read.options.size()) + " texts",
                               "expected " + std::to_string(wanted) +
                                   ", one for each of the module's options");
            texts.modules[*at] = std::move(read);
        }
        own->finish();
        course.texts.push_back(std::move(texts));
    }
    table.finish();
}

}  // namespace

Result<Course> parse_course(std::string_view toml, const std::string& where) {
    SONOCASE_TRY(const auto root, TomlTable::parse(toml, where));
    Course course;
    need(root, "name", course.name, "expected a short name, as in \"first-needles\"");
    course.title = course.name;
    root.text("title", course.title);
    root.text("text", course.text);
    course.text = running(course.text);
    const std::vector<TomlTable> modules = root.tables("modules");
    if (modules.empty())
        root.add_fault("modules", "is missing", "expected at least one [[modules]]");
    if (modules.size() > static_cast<std::size_t>(kMaxModules))
        root.add_fault("modules", "has " + std::to_string(modules.size()) + " modules",
                       "expected at most " + std::to_string(kMaxModules));
    for (const TomlTable& table : modules) {
        CourseModule m = read_module(table);
        for (const CourseModule& earlier : course.modules)
            if (earlier.name == m.name)
                table.add_fault("name", "\"" + m.name + "\" is given twice",
                                "expected another name for each module");
        course.modules.push_back(std::move(m));
    }
    if (const auto texts = root.table("texts")) read_texts(*texts, course);
    root.finish();
    if (root.fault()) return *root.fault();
    return course;
}

Course course_in(const Course& course, std::string_view language) {
    Course out = course;
    const auto take = [](std::string& to, const std::string& own) {
        if (!own.empty()) to = own;
    };
    for (const Course::Texts& texts : course.texts) {
        if (texts.language != language) continue;
        take(out.title, texts.title);
        take(out.text, texts.text);
        for (std::size_t i = 0; i < out.modules.size(); ++i) {
            const Course::Texts::Module& own = texts.modules[i];
            take(out.modules[i].title, own.title);
            take(out.modules[i].text, own.text);
            take(out.modules[i].question, own.question);
            take(out.modules[i].because, own.because);
            if (!own.options.empty()) out.modules[i].options = own.options;
        }
    }
    return out;
}

}  // namespace sonocase
