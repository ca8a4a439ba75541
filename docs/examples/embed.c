/* Fits the face in a photo (binary PPM) and renders it turned by 25 degrees: embed IN.ppm OUT.ppm
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <stymo.h>

static int failed(const char* what, const char* why) {
    fprintf(stderr, "embed: %s: %s\n", what, why);
    return 1;
}

int main(int argc, char** argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: embed IN.ppm OUT.ppm\n");
        return 2;
    }
    int width = 0, height = 0, largest = 0;
    FILE* in = fopen(argv[1], "rb");
    if (in == NULL) return failed(argv[1], strerror(errno));
    if (fscanf(in, "P6 %d %d %d", &width, &height, &largest) != 3 || width < 1 || height < 1 ||
        largest != 255 || fgetc(in) == EOF)
        return failed(argv[1], "not a binary PPM of 8 bits without comments");
    size_t bytes = (size_t)width * (size_t)height * 3;
    uint8_t* photo = malloc(bytes);
    if (photo == NULL || fread(photo, 1, bytes, in) != bytes) return failed(argv[1], "too short");
    fclose(in);

    stymo_model* model = stymo_model_load(NULL, STYMO_CONFIGS);
    if (model == NULL) return failed("the model", stymo_error());
    stymo_face* face = stymo_fit(model, photo, height, width, 30);
    if (face == NULL) return failed("the fit", stymo_error());
    fprintf(stderr, "%s\n", stymo_face_warnings(face));

    const int side = stymo_model_side(model);
    const double angles[3] = {25.0, 0.0, 0.0}; /* yaw, pitch, roll */
    uint8_t* frame = malloc((size_t)side * (size_t)side * 3);
    if (stymo_render(model, face, angles, side, frame) != 0) return failed("the view", stymo_error());
    FILE* out = fopen(argv[2], "wb");
    if (out == NULL) return failed(argv[2], strerror(errno));
    fprintf(out, "P6 %d %d 255\n", side, side);
    fwrite(frame, 3, (size_t)side * (size_t)side, out);
    if (fclose(out) != 0) return failed(argv[2], strerror(errno));

    stymo_face_free(face);
    stymo_model_free(model);
    free(photo);
    free(frame);
    return 0;
}
