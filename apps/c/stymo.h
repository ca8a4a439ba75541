/* C interface of stymo: from a photo to a face, from a face to images.
 *
 * Functions that return a pointer return NULL if they fail, those that return int 0 for success and
 * -1 for a failure; stymo_error() then says why. No C++ exception leaves them. Every face and model
 * that is returned belongs to the caller, who frees it. Threads may use one model at the same time;
 * a face must not change (stymo_tune) or be freed while another thread uses it.
 *
 * Images are 8-bit sRGB, three bytes for each pixel, rows from top to bottom without gaps. */
#ifndef STYMO_H
#define STYMO_H

#include <stdint.h>

#define STYMO_API __attribute__((visibility("default")))
#define STYMO_CODE_SIZE 306 /* identity 100, expression 79, texture 100, light 27 */

#ifdef __cplusplus
extern "C" {
#endif

typedef struct stymo_model stymo_model;
typedef struct stymo_face stymo_face;

STYMO_API const char* stymo_version(void); /* "0.1.0" */
/* What the last call on this thread that failed could not do, in one line; "" if none failed. Valid
 * until the next call on this thread. */
STYMO_API const char* stymo_error(void);
/* Threads of all calls of this process; 0: one for each processor. Not while a call runs. */
STYMO_API int stymo_set_threads(int count);

/* Reads a model's file, or the model that comes with stymo under the name "faces-512", or if `path`
 * is NULL faces-256. `configs` is the folder share/stymo/configs of an installation, with these
 * models and the networks for photos; NULL: it is searched for near the library and the program. */
STYMO_API stymo_model* stymo_model_load(const char* path, const char* configs);
STYMO_API void stymo_model_free(stymo_model* model); /* NULL: does nothing */
/* Side of the model's images in pixels; -1 if `model` is NULL. */
STYMO_API int stymo_model_side(const stymo_model* model);

/* Finds the clearest face of a photo of height * width pixels and fits codes to it, in so many
 * steps; 0: as many as stymo-fit. */
STYMO_API stymo_face* stymo_fit(const stymo_model* model, const uint8_t* rgb, int height, int width,
                                int steps);
/* Tunes the decoder to a face of stymo_fit for so many seconds. */
STYMO_API int stymo_tune(const stymo_model* model, stymo_face* face, double seconds);
/* A new face; `truncation` from 0 (the mean face) to 1 (as varied as the training faces). */
STYMO_API stymo_face* stymo_sample(const stymo_model* model, uint64_t seed, double truncation);
/* The target with groups of the source's codes, `take`: "id", "expr", "tex", "light", joined by
 * commas. */
STYMO_API stymo_face* stymo_mix(const stymo_face* target, const stymo_face* source,
                                const char* take);
/* Read and write codes.json and, unless it is NULL, tuned.safetensors, as stymo-fit does. */
STYMO_API stymo_face* stymo_face_read(const stymo_model* model, const char* codes,
                                      const char* tuned);
STYMO_API int stymo_face_write(const stymo_face* face, const char* codes, const char* tuned);
/* What the last fit or tuning of this face warns of, in lines; "" for nothing, NULL if `face` is
 * NULL. Valid until the face changes or is freed. */
STYMO_API const char* stymo_face_warnings(const stymo_face* face);
/* PSNR of the face and its photo in decibels; NaN unless stymo_fit made it. */
STYMO_API double stymo_face_psnr(const stymo_face* face);
STYMO_API int stymo_face_codes(const stymo_face* face, float codes[STYMO_CODE_SIZE]);
STYMO_API void stymo_face_free(stymo_face* face); /* NULL: does nothing */

/* Renders a face into side * side pixels; `side` is 64, 128, 256 ... up to that of the model.
 * `angles` are yaw, pitch and roll in degrees; NULL: the face's own pose.
 * The head fades to black at a soft edge. */
STYMO_API int stymo_render(const stymo_model* model, const stymo_face* face, const double* angles,
                           int side, uint8_t* rgb);

#ifdef __cplusplus
}
#endif

#endif
