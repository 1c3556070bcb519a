#include <png.h>

#include "palpate/base/error.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/picture/picture.hpp"

namespace palpate {

void write_png(const std::filesystem::path& path, const Image& image) {
  const std::size_t width = static_cast<std::size_t>(std::max(image.width, 0));
  const std::size_t height = static_cast<std::size_t>(std::max(image.height, 0));
  if (width * height == 0 || image.rgb.size() != 3 * width * height)
    throw Error(ErrorKind::internal, "{}: a picture of {} x {} pixels with {} bytes cannot be written",
                path.string(), image.width, image.height, image.rgb.size());
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(width);
  png.height = static_cast<png_uint_32>(height);
  png.format = PNG_FORMAT_RGB;
  std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(png), '\0');
  png_alloc_size_t size = bytes.size();
  if (!png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr))
    throw Error(ErrorKind::internal, "{}: {}", path.string(), png.message);
  AtomicFile file(path);
  file.write(std::string_view(bytes).substr(0, size));
  file.commit();
}

}  // namespace palpate
