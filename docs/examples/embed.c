/* Fits the face in a photo (binary PPM) and renders it turned by 25 degrees: embed IN.ppm OUT.ppm
 */
#include <stdio.h>
#include <stdlib.h>
#include <stymo.h>

static int failed(const char* what) {
    fprintf(stderr, "embed: %s: %s\n", what, stymo_error());
    return 1;
}

int main(int argc, char** argv) {
    int width = 0, height = 0;
    FILE* in = argc == 3 ? fopen(argv[1], "rb") : NULL;
    if (in == NULL || fscanf(in, "P6 %d %d 255", &width, &height) != 2 || fgetc(in) == EOF) {
        fprintf(stderr, "usage: embed IN.ppm OUT.ppm\n");
        return 2;
    }
    size_t bytes = (size_t)width * (size_t)height * 3;
    uint8_t* photo = malloc(bytes);
    if (photo == NULL || fread(photo, 1, bytes, in) != bytes) return failed(argv[1]);
    fclose(in);

    stymo_model* model = stymo_model_load(NULL, STYMO_CONFIGS);
    if (model == NULL) return failed("the model");
    stymo_face* face = stymo_fit(model, photo, height, width, 30);
    if (face == NULL) return failed("the fit");

    const int side = stymo_model_side(model);
    const double angles[3] = {25.0, 0.0, 0.0}; /* yaw, pitch, roll */
    uint8_t* frame = malloc((size_t)side * (size_t)side * 3);
    if (stymo_render(model, face, angles, side, frame) != 0) return failed("the view");
    FILE* out = fopen(argv[2], "wb");
    if (out == NULL) return failed(argv[2]);
    fprintf(out, "P6 %d %d 255\n", side, side);
    fwrite(frame, 3, (size_t)side * (size_t)side, out);

    stymo_face_free(face);
    stymo_model_free(model);
    free(photo);
    free(frame);
    return fclose(out);
}
