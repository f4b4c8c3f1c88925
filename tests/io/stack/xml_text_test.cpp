#include "io/stack/xml_text.h"

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

TEST(XmlText, WritesWhatXmlOrATerminalWouldReadAsEntitiesAndEscapes) {
  EXPECT_EQ(xmlText("VeroCY-V"), "VeroCY-V");
  EXPECT_EQ(xmlText("a<b> & \"c\""), "a&lt;b&gt; &amp; &quot;c&quot;");
  EXPECT_EQ(xmlText("\x1b[31m</Name>").find('\x1b'), std::string::npos);
  EXPECT_EQ(xmlText("]]><!--").find('<'), std::string::npos);
}

}  // namespace
}  // namespace vdbdither
